# %% [markdown]
# # Is the sigma true?
# Many runs with drawn noise and drawn initial errors: the errors of a consistent filter agree with its
# sigma, and come near the Cramer-Rao bound.

# %%
import navfuse

scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART).set("estimator.stop", "150 s")
report = scenario.monte_carlo(8)
point = report["points"][0]
print(f"{point['runs']} runs, {point['failed']} failed")

# %%
point["verdict"]

# %% [markdown]
# A DVL whose noise is stated three times too small is overconfident, and each run reports it.

# %%
wrong = scenario.set({"sensor.dvl.noise": "3 mm/s", "sensor.dvl.simulation.noise": 3.3})
wrong.run().verdict
