"""Measures what docs/src/how-to/python.md states about time and memory.

    python python/tests/measure.py              # all: some minutes of two idle cores
    python python/tests/measure.py sensor       # or some of: command sensor session threads runs epochs
    python python/tests/measure.py --scale 0.1  # with fewer samples

The package must be a build for release, such as a wheel by maturin. Times are of the processor, the least of
several turns that alternate.
"""

import argparse
import os
import resource
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
import pandas

import navfuse
from navfuse import _navfuse

QUICK = navfuse.Scenario.from_toml(navfuse.QUICKSTART)


class Log(navfuse.Sensor):
    """Speed along the axes of the body, with a scale factor."""

    type = "log"
    channels = {"ahead": "m/s", "right": "m/s", "down": "m/s"}
    reads = ("ins.attitude", "ins.velocity")
    parameters = {"scale": navfuse.Parameter(1.0, sigma=0.05)}
    noise = 0.02

    def predict(self, x):
        return x.scale * (x.attitude.T @ x.velocity)


def resident():
    """Memory of this process, MB, now and at most."""
    with open("/proc/self/statm") as file:
        now = int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    return now, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6


def least(turns, *works):
    """The least time of the processor of each work, s."""
    times = [[] for _ in works]
    for _ in range(turns):
        for work, spent in zip(works, times):
            before = time.process_time()
            work()
            spent.append(time.process_time() - before)
    return [min(spent) for spent in times]


def recorded(scenario):
    """The samples of a run, as tables."""
    with tempfile.TemporaryDirectory() as folder:
        scenario.set("sink.rerun.enabled", False).run(out=folder)
        return navfuse.read_log(folder).samples


def command(scale):
    """A run with its log and recording through Python, against the command."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "q.toml"
        path.write_text(navfuse.QUICKSTART)
        quiet = os.open(os.devnull, os.O_WRONLY)
        out = os.dup(1)

        def by_command():
            os.dup2(quiet, 1)
            _navfuse.command(["run", str(path), "--out", os.path.join(folder, "a"), "--quiet"])
            os.dup2(out, 1)

        def by_python():
            navfuse.Scenario.load(path).run(out=os.path.join(folder, "b"))

        a, b = least(15, by_command, by_python)
    print(f"a run with log and recording: {b:.3f} s in Python, {a:.3f} s by the command: {b / a:.3f}")


def sensor(scale):
    """A sensor of three channels at 5 Hz in Python, against the same one in Rust."""
    settings = {"simulation": {"rate": "5 Hz"}, "noise": "2 cm/s", "type": "dvl", "scale": {"sigma": "5 %"}}
    with tempfile.TemporaryDirectory() as folder:
        for rate in (100, 400):
            alone = QUICK.set("sensor.imu.simulation.rate", f"{rate} Hz")
            python = alone.with_sensors(Log).set("sensor.log", {"simulation": {"rate": "5 Hz"}})
            rust = alone.set("sensor.log", settings)
            for name, out in {"with log and recording": folder, "in memory alone": None}.items():
                p, r, n = least(7, *(lambda s=s: s.run(out=out) for s in (python, rust, alone)))
                print(
                    f"a sensor at 5 Hz beside an IMU at {rate} Hz, {name}: {p:.3f} s in Python, "
                    f"{r:.3f} s in Rust, {n:.3f} s without: {p / r:.3f}"
                )


def session(scale):
    """10^6 rows of an IMU pushed in the blocks between other samples, against the replay of their log."""
    rate = 1600 * scale
    fast = QUICK.set({"sensor.imu.simulation.rate": f"{rate} Hz", "sink.rerun.enabled": False})
    with tempfile.TemporaryDirectory() as folder:
        fast.run(out=folder)
        samples = navfuse.read_log(folder).samples
        tables = {k: np.column_stack(list(t.values())) for k, t in samples.items()}
        imu = tables.pop("imu")
        order = list(samples)
        others = sorted((row[0], order.index(k), k, row[1:]) for k, t in tables.items() for row in t)
        cuts = np.searchsorted(imu[:, 0], [row[0] for row in others], side="right")
        log = os.path.join(folder, "run.mcap")

        def replay():
            navfuse.Scenario.load(log).run()

        def push():
            live = navfuse.Session(fast)
            first = 0
            for (at, _, name, values), cut in zip(others, cuts):
                if cut > first:
                    live.push("imu", imu[first:cut, 0], imu[first:cut, 1:])
                    first = cut
                live.push(name, at, values)
            if first < len(imu):
                live.push("imu", imu[first:, 0], imu[first:, 1:])
            live.finish()

        a, b = least(3, replay, push)
    print(f"{len(imu)} rows of an IMU: {b:.2f} s pushed, {a:.2f} s by a replay of the log: {b / a:.3f}")


def threads(scale):
    """Two runs at once, and one after the other."""
    def one():
        QUICK.set("sensor.imu.simulation.rate", "1 kHz").run()

    def both():
        started = [threading.Thread(target=one) for _ in range(2)]
        for thread in started:
            thread.start()
        for thread in started:
            thread.join()

    one()
    spent = []
    for _ in range(5):
        wall, processor = time.perf_counter(), time.process_time()
        both()
        spent.append((time.process_time() - processor) / (time.perf_counter() - wall))
    print(f"two runs in two threads: {max(spent):.2f} cores")


def runs(scale):
    """Memory of 1000 runs."""
    little = QUICK.set({"estimator.start": "1 s", "estimator.stop": "11 s"})
    count = int(1000 * scale)
    for _ in range(20):
        little.run()
    before, _ = resident()
    for _ in range(count):
        little.run()
    after, _ = resident()
    print(f"{count} runs: {before:.1f} MB before, {after:.1f} MB after")


#: Inertial navigation alone, with an epoch for each sample.
INERTIAL = """
name = "inertial"
estimator.output_rate = "100 Hz"
[process.ins]
attitude = { initial = ["0 deg", "0 deg", "0 deg"], sigma = "1 deg" }
velocity = { initial = "0 m/s", sigma = "1 m/s" }
position = { latitude = "43 deg", longitude = "5 deg", height = "0 m", sigma = "1 m" }
[sensor.imu]
gyro_noise = "0.2 deg/h/sqrt(Hz)"
accel_noise = "20 ug/sqrt(Hz)"
"""


def epochs(scale):
    """10^7 epochs as a DataFrame."""
    count = int(1e7 * scale)
    time_s = 1e-2 * np.arange(1.0, count + 1.0)
    imu = {"time_s": time_s, **{f"gyro_{a}": np.zeros(count) for a in "xyz"}}
    imu |= {"accel_x": np.zeros(count), "accel_y": np.zeros(count), "accel_z": np.full(count, -9.8)}
    run = navfuse.Scenario.from_toml(INERTIAL).with_samples(imu=imu).run()
    size = sum(column.nbytes for column in run.columns.values()) / 1e6
    before, most = resident()
    frame = pandas.DataFrame(run.columns, copy=False)
    after, _ = resident()
    assert len(frame) == run.time.size
    print(f"{len(frame)} epochs of {len(run.columns)} numbers, {size:.0f} MB: the frame adds {after - before:.0f} MB; "
          f"{before:.0f} MB after the run, {most:.0f} MB at most")


ALL = {f.__name__: f for f in (command, sensor, session, threads, runs, epochs)}

if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("names", nargs="*", choices=[[], *ALL], default=[])
    parser.add_argument("--scale", type=float, default=1.0)
    given = parser.parse_args()
    for name in given.names or ALL:
        ALL[name](given.scale)
