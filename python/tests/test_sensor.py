"""Sensors in Python: simulated, gated, smoothed and judged as any other."""

import numpy as np
import pytest

import navfuse


class Depth(navfuse.Sensor):
    """Depth below the ellipsoid."""

    type = "python-depth"
    channels = {"depth": "m"}
    reads = ("ins.position",)

    def __init__(self, noise: float = 0.05):
        self.noise = noise

    def predict(self, x):
        return -x.position[2]


class Log(navfuse.Sensor):
    """Speed along the axes of the body, with a scale factor."""

    type = "log"
    channels = {"ahead": "m/s", "right": "m/s"}
    reads = ("ins.attitude", "ins.velocity")
    noise = (0.02, 0.03)

    def __init__(self, truth: float = 1.02):
        self.parameters = {"scale": navfuse.Parameter(initial=1.0, sigma=0.05, truth=truth)}

    def predict(self, x):
        return x.scale * (x.attitude.T @ x["ins.velocity"])[:2]


class FastLog(Log):
    """The same for many states at once."""

    vectorised = True

    def predict(self, x):
        body = np.einsum("nij,ni->nj", x.attitude, x.velocity)
        return x.scale[:, None] * body[:, :2]


class Course(navfuse.Sensor):
    """Yaw of the attitude, which an angle is."""

    type = "course"
    channels = {"yaw": "rad"}
    reads = ("ins.attitude",)
    angles = ("yaw",)
    noise = np.radians(0.5)

    def predict(self, x):
        return np.arctan2(x.attitude[1, 0], x.attitude[0, 0]) + self.turns


LOG = {"sensor.log": {"simulation": {"rate": "5 Hz"}}, "sensor.dvl.enabled": False, "estimator.stop": "180 s"}


def test_a_sensor_in_python_gives_the_estimates_of_the_same_one_in_rust(short):
    built_in = short.set("sensor.depth.bias", 0.0).set("sensor.depth", {"noise": "5 cm", "simulation": {"rate": "2 Hz"}})
    other = built_in.with_sensors(Depth).set("sensor.depth.type", "python-depth").set("sensor.depth.noise", 0.05)
    expected, run = built_in.run(), other.run()
    assert run.innovations["depth"].time.size == expected.innovations["depth"].time.size
    for name in ("ins.position", "ins.velocity", "ins.attitude", "dvl.scale"):
        assert np.allclose(run[name].estimate, expected[name].estimate, rtol=1e-9, atol=1e-9), name
        assert np.allclose(run[name].sigma, expected[name].sigma, rtol=1e-6), name


def test_a_state_of_its_own_is_estimated_with_an_honest_sigma(short):
    run = short.with_sensors(Log).set(LOG).run()
    scale = run["log.scale"]
    assert scale.sigma[-1, 0] < 0.01 < scale.sigma[0, 0]
    assert abs(scale.estimate[-1, 0] - 1.02) < 4.0 * scale.sigma[-1, 0]
    assert run.verdict.level == "consistent", run.verdict
    assert run.innovations["log"].units == ("m/s", "m/s")


def test_a_vectorised_sensor_gives_the_same_estimates(short):
    one, many = (short.with_sensors(kind).set(LOG).run() for kind in (Log, FastLog))
    assert np.allclose(one["log.scale"].estimate, many["log.scale"].estimate, rtol=1e-12)


def test_an_angle_is_compared_within_half_a_turn(short):
    settings = {"sensor.course": {"simulation": {"rate": "1 Hz"}}}
    runs = []
    for turns in (0.0, 2.0 * np.pi):
        kind = type("Turned", (Course,), {"turns": turns})
        recorded = short.with_sensors(type("Plain", (Course,), {"turns": 0.0})).set(settings)
        runs.append(short.with_sensors(kind).set(settings).run())
        assert recorded.check().sensors[-1]["name"] == "course"
    assert np.allclose(runs[0].innovations["course"].value, runs[1].innovations["course"].value, atol=1e-9)


def test_a_sensor_in_python_is_smoothed_and_judged_by_campaigns(short):
    scenario = short.with_sensors(Log).set(LOG).set("estimator.stop", "100 s")
    filtered, smoothed = scenario.run(), scenario.smooth()
    assert smoothed["log.scale"].sigma[0, 0] < filtered["log.scale"].sigma[0, 0]
    report = scenario.set("sensor.log", {"simulation": {"rate": "1 Hz"}}).monte_carlo(2)
    assert any(state["state"].startswith("log.scale") for state in report["points"][0]["states"])


def test_an_exception_in_a_sensor_ends_the_run_and_is_raised(short):
    class Broken(Log):
        def predict(self, x):
            if self.calls > 50:
                raise LookupError("no calibration")
            self.calls += 1
            return super().predict(x)

        calls = 0

    with pytest.raises(LookupError, match="no calibration"):
        short.with_sensors(Broken).set(LOG).run()
    with pytest.raises(ValueError, match=r"shape \(1, 3\) for 1 states of 2 channels"):
        short.with_sensors(type("Wide", (Log,), {"predict": lambda self, x: x.velocity})).set(LOG).run()
    with pytest.raises(AttributeError, match="does not read 'position'"):
        short.with_sensors(type("Blind", (Log,), {"predict": lambda self, x: x.position})).set(LOG).run()


def test_a_mistake_in_a_table_of_a_sensor_in_python_has_its_place(short):
    with pytest.raises(navfuse.ScenarioError, match="trth.*did you mean .truth.") as caught:
        short.with_sensors(Log).set(LOG).set("sensor.log.trth", 1.0).check()
    assert caught.value.key == "sensor.log.trth"
    with pytest.raises(navfuse.ScenarioError, match="there is no state ins.sped"):
        short.with_sensors(type("Lost", (Log,), {"reads": ("ins.sped",)})).set(LOG).check()
    with pytest.raises(navfuse.ScenarioError, match="'5 cm'; a number in SI is needed"):
        short.with_sensors(Depth).set("sensor.python-depth", {"noise": "5 cm"}).check()
    with pytest.raises(navfuse.ScenarioError, match="positive 1-sigma"):
        short.with_sensors(type("Exact", (Log,), {"noise": 0.0})).set(LOG).check()
    with pytest.raises(TypeError, match="derived from navfuse.Sensor"):
        short.with_sensors(int)
