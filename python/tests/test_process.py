"""Processes in Python: driven, simulated, smoothed and judged as any other."""

import numpy as np
import pytest

import navfuse

class Car(navfuse.Process):
    """Dead reckoning in the plane: speed and turn rate, with a scale factor of the speed."""

    type = "car"
    channels = {"speed": "m/s", "turn": "rad/s"}
    noise = (0.05, 0.01)
    states = {
        "place": navfuse.Parameter((0.0, 0.0), sigma=3.0),
        "yaw": navfuse.Parameter(sigma=0.2, kind="angle"),
    }
    parameters = {"scale": navfuse.Parameter(1.0, sigma=0.05)}

    def propagate(self, x, u, dt):
        yaw = x.yaw + u.turn * dt
        mean = x.yaw + 0.5 * u.turn * dt
        step = x.scale * u.speed * dt
        return {"place": x.place + np.stack([step * np.cos(mean), step * np.sin(mean)], axis=-1), "yaw": yaw}

    def follow(self, motion):
        return {"place": plane(motion.position), "yaw": heading(motion)}

    def simulate(self, before, after, dt):
        if dt == 0.0:
            return 0.0, 0.0
        turn = (heading(after) - heading(before) + np.pi) % (2 * np.pi) - np.pi
        return np.linalg.norm(plane(after.position) - plane(before.position)) / dt / after.scale, turn / dt


class FastCar(Car):
    type = "fast-car"
    vectorised = True

    def propagate(self, x, u, dt):
        mean, step = x.yaw + 0.5 * u.turn * dt, x.scale * u.speed * dt
        step = np.stack([step * np.cos(mean), step * np.sin(mean)], axis=-1)
        return {"place": x.place + step, "yaw": x.yaw + u.turn * dt}


RADIUS = 6_371_000.0
START = np.radians([48.0, 11.0])


def plane(position):
    """North and east of the start, m, on a sphere: position and model agree within the test's sigma."""
    north, east = (position[:2] - START) * RADIUS
    return np.array([north, east * np.cos(START[0])])


def heading(motion):
    return np.arctan2(motion.attitude[1, 0], motion.attitude[0, 0])


class Fixes(navfuse.Sensor):
    """Fixes of the place of the car."""

    type = "fixes"
    channels = {"north": "m", "east": "m"}
    reads = ("car.place",)
    noise = 0.5

    def predict(self, x):
        return x.place


TRACK = """
name = "car"
estimator.stop = "30 s"
[process.car]
[sensor.car.simulation]
rate = "20 Hz"
[sensor.fixes.simulation]
rate = "1 Hz"
[sensor.reference.simulation]
rate = "20 Hz"
[source.simulation.start]
latitude = "48 deg"
longitude = "11 deg"
heading = "170 deg"
"""
for motion in ('type = "surge"\nduration = "10 s"\nspeed = "5 m/s"', 'type = "turn"\nduration = "20 s"\nangle = "200 deg"',
               'type = "cruise"\nduration = "20 s"', 'type = "turn"\nduration = "10 s"\nangle = "-90 deg"'):
    TRACK += f"[[source.simulation.segments]]\n{motion}\n"


FAST = {"process.car.type": "fast-car", "sensor.car.type": "fast-car"}


@pytest.fixture(scope="module")
def car():
    return navfuse.Scenario.from_toml(TRACK).with_sensors(Fixes).with_processes(Car)


def test_a_process_in_python_is_driven_by_its_sensor_and_has_an_honest_sigma(car):
    run = car.run()
    assert run.summary["samples"]["car"]["used"] > 500
    assert run.verdict.level == "consistent", run.verdict
    assert run["car.yaw"].unit == "deg"
    judged = car.with_processes(FastCar).set(FAST).set("sensor.reference.simulation.rate", "1 Hz")
    report = judged.monte_carlo(24, seed=77)
    assert report["points"][0]["verdict"]["consistent"], report["points"][0]["verdict"]
    assert run["car.scale"].sigma[-1, 0] < 0.025 < run["car.scale"].sigma[0, 0]


def test_a_vectorised_process_gives_the_same_estimates(car):
    one, many = car.run(), car.with_processes(FastCar).set(FAST).run()
    for name in ("car.place", "car.yaw", "car.scale"):
        assert np.allclose(one[name].estimate, many[name].estimate, rtol=1e-9, atol=1e-9)
        assert np.allclose(one[name].sigma, many[name].sigma, rtol=1e-6)


def test_a_process_in_python_is_smoothed_and_reads_tables(car):
    filtered, smoothed = car.run(), car.smooth()
    assert smoothed["car.place"].sigma[150, 0] < filtered["car.place"].sigma[150, 0]
    time = np.arange(1.0, 11.0, 0.1)
    straight = {"time_s": time, "speed": np.full(time.size, 2.0), "turn": np.zeros(time.size)}
    alone = navfuse.Scenario.from_toml("[process.car]\n[sensor.car]").with_processes(Car)
    place = alone.with_samples(car=straight).run()["car.place"]
    length = place.time[-1] - place.time[0]
    assert np.allclose(place.estimate[-1], [2.0 * length, 0.0], atol=1e-9)
    # the position of a speed with white noise of 0.05 m/s in each of the samples of 0.1 s
    drift = np.sqrt(place.sigma[-1, 0] ** 2 - place.sigma[0, 0] ** 2 - (0.05 * 2.0 * length) ** 2)
    assert np.isclose(drift, 0.05 * np.sqrt(0.1 * length), rtol=1e-6)


def test_a_gap_of_the_driving_sensor_and_an_exception_end_the_run(car):
    with pytest.raises(navfuse.RunError, match="no driving sample for 2.0.. s; raise max_gap"):
        car.set("sensor.car.simulation.outages", [["10 s", "12 s"]]).run()
    patient = type("Patient", (Car,), {"type": "patient", "max_gap": 3.0})
    settings = {"process.car.type": "patient", "sensor.car.type": "patient"}
    outage = car.with_processes(patient).set(settings).set("sensor.car.simulation.outages", [["10 s", "12 s"]])
    assert outage.run().verdict.level == "consistent"

    def broken(self, x, u, dt):
        raise LookupError("no wheel")

    for part, message in ((broken, "no wheel"), (lambda self, x, u, dt: {"yaw": x.yaw}, "no 'place'")):
        kind = type("Broken", (Car,), {"type": "patient", "propagate": part})
        with pytest.raises((LookupError, ValueError), match=message):
            car.with_processes(kind).set(settings).run()


def test_a_mistake_in_a_table_of_a_process_has_its_place(car):
    with pytest.raises(navfuse.ScenarioError, match="there is no driving sensor wheels") as caught:
        car.set("process.car.sensor", "wheels").check()
    assert caught.value.key == "process.car.sensor"
    with pytest.raises(navfuse.ScenarioError, match="positive 1-sigma"):
        car.with_processes(type("Exact", (Car,), {"type": "exact", "noise": 0.0})).set(
            {"process.car.type": "exact", "sensor.car.type": "exact"}
        ).check()
    with pytest.raises(TypeError, match="derived from navfuse.Process"):
        car.with_processes(Fixes)
