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
    """Speed along the axes of the body, with a scale factor.

    Args:
        truth: scale factor of a simulation.
    """

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


def counted(kind):
    """The class, with the number of its predictions in ``calls``."""

    class Counted(kind):
        calls = 0

        def predict(self, x):
            type(self).calls += 1
            return super().predict(x)

    return Counted


def test_derivatives_of_a_class_for_one_state_cost_one_call(short):
    once = counted(Log)
    run = short.with_sensors(once).set(LOG).run()
    samples = run.innovations["log"].time.size
    # simulation from zero on, derivatives, and their change over time, a call each; curvature sometimes
    assert once.calls < 5 * samples

    class Branching(Log):
        def predict(self, x):
            return super().predict(x) if x.velocity[0] < 1e6 else (0.0, 0.0)

    other = counted(Branching)
    branched = short.with_sensors(other).set(LOG).run()
    assert other.calls > 15 * samples
    for name in ("log.scale", "ins.velocity"):
        assert np.allclose(run[name].estimate, branched[name].estimate, rtol=1e-9, atol=1e-9)
        assert np.allclose(run[name].sigma, branched[name].sigma, rtol=1e-6)


ROWS = np.random.default_rng(5).normal(size=(6, 13))

EQUATIONS = {
    "matrix and vector": lambda x: x.attitude.T @ x.velocity,
    "two matrices": lambda x: (x.attitude @ x.attitude.T)[2],
    "vector and matrix": lambda x: x.velocity @ x.attitude,
    "vectors": lambda x: x.velocity @ x.velocity,
    "a matrix of numbers": lambda x: np.eye(3)[1:] @ x.velocity,
    "an element of a matrix": lambda x: np.arctan2(x.attitude[1, 0], x.attitude[0, 0]),
    "a norm": lambda x: np.linalg.norm(x.velocity),
    "an array of elements": lambda x: np.array([x.velocity[0] / x.scale, np.hypot(*x.velocity[:2])]),
    "functions of an array of elements": lambda x: np.sin(np.array([x.velocity[2], 2.0 * x.scale])) ** 2,
    "a list": lambda x: [x.scale - 1, abs(x.velocity[1])],
    "a product with an array of elements": lambda x: x.attitude.T @ np.array([x.scale, 0.0, x.velocity[2]]),
    "stacked": lambda x: np.stack([x.velocity, x.scale * x.velocity], axis=-1),
    "joined": lambda x: np.concatenate([x.velocity[:1], x.velocity[2:], [1.0]]),
    "a sum": lambda x: np.sum(x.velocity**2) + x.attitude.sum(axis=0),
    "a cross product": lambda x: np.cross(x.velocity, [0.0, 1.0, 2.0]),
    "a choice": lambda x: np.where(x.velocity > 0.0, x.velocity, x.scale * x.velocity),
    "a dot product": lambda x: np.dot(x.attitude, x.velocity) + x.velocity.dot(x.velocity),
    "a number": lambda x: 3.0,
}

BRANCHES = {
    "a branch": lambda x: x.velocity if x.scale > 0.0 else -x.velocity,
    "math": lambda x: __import__("math").sin(x.scale),
    "the largest": lambda x: np.max(x.velocity),
    "an assignment": lambda x: (x.velocity + 0.0).__setitem__(0, 1.0),
    "a float": lambda x: float(x.scale),
}


@pytest.mark.parametrize("equation", EQUATIONS.values(), ids=EQUATIONS)
def test_equations_for_one_state_are_those_of_many(equation):
    from navfuse._many import numbers
    from navfuse._sensor import Places

    places = Places({"ins.attitude": (3, 3), "ins.velocity": (3,), "log.scale": ()})
    many = numbers(equation(places.many(ROWS, places)), len(ROWS))
    single = np.array([np.asarray(equation(places.states(row, places)), float) for row in ROWS])
    assert many.shape == single.shape and np.allclose(many, single, rtol=1e-13, atol=1e-14)


@pytest.mark.parametrize("equation", BRANCHES.values(), ids=BRANCHES)
def test_what_many_states_cannot_do_is_an_exception(equation):
    from navfuse._sensor import Places

    places = Places({"ins.attitude": (3, 3), "ins.velocity": (3,), "log.scale": ()})
    with pytest.raises((TypeError, AttributeError)):
        equation(places.many(ROWS, places))


def test_jax_gives_the_derivatives(short):
    jnp = pytest.importorskip("jax.numpy")

    class Exact(Log):
        jax = True

        def predict(self, x):
            ahead, right, _ = x.attitude.T @ x.velocity
            return x.scale * jnp.array([ahead, right])

    plain, exact = (short.with_sensors(kind).set(LOG).run() for kind in (Log, Exact))
    for name in plain:
        assert np.allclose(plain[name].estimate, exact[name].estimate, rtol=1e-8, atol=1e-8), name
        assert np.allclose(plain[name].sigma, exact[name].sigma, rtol=1e-8), name


def test_a_class_for_jax_names_the_package_that_is_missing(short, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "jax", None)
    with pytest.raises(navfuse.ScenarioError, match="pip install jax"):
        short.with_sensors(type("Exact", (Log,), {"jax": True})).set(LOG).check()


def test_the_conformance_kit_checks_a_sensor_in_python(short):
    settings = LOG | {"estimator.stop": "160 s"}  # its middle is after the start
    findings = short.with_sensors(Log).set(settings).conformance()
    assert all(f["passed"] for f in findings), [f for f in findings if not f["passed"]]
    assert {"channels", "jacobian", "noise", "determinism", "checkpoint", "nis"} <= {f["check"] for f in findings}

    class Silent(Log):
        def __init__(self, speed_of_sound: float = 1500.0):
            super().__init__()

    undescribed = short.with_sensors(Silent).set(settings).set("estimator.stop", "70 s").conformance()
    assert any("speed_of_sound" in f["text"] and not f["passed"] for f in undescribed)


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
    with pytest.raises(ValueError, match=r"shape \(3,\) for 1 states of 2 channels"):
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
