# %% [markdown]
# # A sensor of one's own
# A speed log: speed ahead, with a scale factor that the filter estimates.

# %%
import navfuse


class Log(navfuse.Sensor):
    """Speed ahead through the axes of the body, with a scale factor."""

    type = "log"
    channels = {"speed": "m/s"}
    reads = ("ins.attitude", "ins.velocity")

    def __init__(self, noise: float = 0.03, truth: float = 1.03):
        self.noise = noise
        self.parameters = {"scale": navfuse.Parameter(initial=1.0, sigma=0.05, truth=truth)}

    def predict(self, x):
        return x.scale * (x.attitude.T @ x.velocity)[0]


# %%
scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART).with_sensors(Log)
scenario = scenario.set("sensor.log", {"simulation": {"rate": "2 Hz"}, "gate": 0.999})
run = scenario.run()
run

# %%
scale = run["log.scale"]
assert abs(scale.error[-1, 0]) < 4.0 * scale.sigma[-1, 0]
figure = run.plot("log.scale", "log")
