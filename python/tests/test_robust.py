"""What is damaged raises an exception and never ends the interpreter; threads, signals and memory."""

import random
import signal
import subprocess
import sys
import threading
import time

import matplotlib
import numpy as np
import pandas
import pytest
from test_sensor import Log

import navfuse

matplotlib.use("agg")


def resident():
    """The memory of this process, KiB."""
    with open("/proc/self/status") as status:
        return next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))


def damaged(data, random):
    """Bytes with some of them changed, cut out or doubled."""
    data = bytearray(data)
    for _ in range(random.randint(1, 8)):
        at = random.randrange(len(data))
        kind = random.randrange(3)
        if kind == 0:
            data[at] = random.randrange(256)
        elif kind == 1:
            del data[at : at + random.randint(1, 40)]
        else:
            data[at:at] = data[at : at + random.randint(1, 40)]
    return bytes(data)


def test_a_hundred_damaged_scenarios_run_or_raise(short):
    draws, raised = random.Random(1), 0
    text = short.set("estimator.stop", "61 s").to_toml().encode()
    for _ in range(100):
        try:
            scenario = navfuse.Scenario.from_toml(damaged(text, draws).decode(errors="replace"))
            scenario.set("estimator.stop", "61 s").run()
        except navfuse.NavfuseError as error:
            assert error.message
            raised += 1
    assert raised > 50


def test_a_hundred_damaged_logs_are_read_in_part_or_raise(short, tmp_path):
    short.set({"sink.rerun.enabled": False, "estimator.stop": "61 s"}).run(out=tmp_path / "whole")
    data = (tmp_path / "whole" / "run.mcap").read_bytes()
    draws, path, read, raised = random.Random(2), tmp_path / "damaged.mcap", 0, 0
    for _ in range(100):
        path.write_bytes(damaged(data, draws))
        try:
            navfuse.read_log(path)
            read += 1
        except navfuse.DataError as error:
            assert str(path) in str(error)
            raised += 1
    assert read > 0 and raised > 0


def test_a_hundred_tables_with_any_headings_are_taken_or_raise(short, recwarn):
    draws, taken, raised = random.Random(3), 0, 0
    words = ["time", "t [ms]", "stamp", "vel", "v", "depth", "x", "y [cm/s]", "_z_mps", "(m)", "", "p [dbar]", "date"]
    cells = [0.0, 1.5, -3.0, 1e300, np.nan, np.inf, None, "a", "2024-01-01", 1_700_000_000_000]
    for _ in range(100):
        columns = {" ".join(draws.choices(words, k=2)): draws.choices(cells, k=20) for _ in range(draws.randint(1, 6))}
        if draws.random() < 0.8:
            columns["time_s"] = np.arange(60.5, 70.5, 0.5)
            columns[draws.choice(["Vel X (kn)", "Depth [ft]"])] = np.linspace(0.0, 1.0, 20)
        try:
            short.with_samples(**{draws.choice(["dvl", "depth", "imu", "reference"]): pandas.DataFrame(columns)})
            taken += 1
        except (ValueError, navfuse.NavfuseError) as error:
            assert str(error)
            raised += 1
    assert taken > 0 and raised > 0


@pytest.mark.parametrize(
    "value", [np.nan, np.inf, -1e300, 1e18, "x", None, [[[1.0]]], {}, object(), np.array(["a"])]
)
def test_any_value_that_is_pushed_is_taken_or_raises(short, value):
    session = navfuse.Session(short)
    for sensor, time_s, values in (("depth", value, 1.0), ("depth", 1.0, value), ("dvl", [1.0, 0.0], value)):
        try:
            session.push(sensor, time_s, values)
        except (ValueError, TypeError, navfuse.NavfuseError):
            pass
    session.tick(5.0)
    with pytest.raises(navfuse.RunError):
        session.finish()


def test_two_runs_at_once_are_those_of_one_after_the_other(short, run):
    results = {}
    threads = [threading.Thread(target=lambda k=k: results.update({k: short.run()})) for k in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for other in results.values():
        assert np.array_equal(other["ins.position"].estimate, run["ins.position"].estimate)


def test_other_threads_go_on_during_a_run(short):
    ticks, over = [0], threading.Event()

    def count():
        while not over.is_set():
            ticks[0] += 1
            time.sleep(1e-3)

    thread = threading.Thread(target=count)
    thread.start()
    whole = short.set("estimator.stop", "600 s")
    before = ticks[0]
    whole.run()
    during = ticks[0] - before
    over.set()
    thread.join()
    assert during > 10


def test_ctrl_c_ends_a_run():
    text = (
        "import navfuse, signal\n"
        # a parent in the background ignores Ctrl-C, and its children too
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "s = navfuse.Scenario.from_toml(navfuse.QUICKSTART).set('sensor.imu.simulation.rate', '20 kHz')\n"
        "print('runs', flush=True)\n"
        "try:\n    s.run()\n"
        "except KeyboardInterrupt:\n    print('interrupted')\n"
    )
    process = subprocess.Popen([sys.executable, "-c", text], stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "runs\n"
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=20)[0] == "interrupted\n" and process.returncode == 0


def test_many_runs_leave_no_memory(short):
    if not sys.platform.startswith("linux"):
        pytest.skip("the memory of a process is read from /proc")
    little = short.set({"estimator.start": "1 s", "estimator.stop": "2 s"})
    classes = little.with_sensors(Log).set("sensor.log", {"simulation": {"rate": "5 Hz"}})
    for _ in range(50):
        little.run()
        classes.run()
    before = resident()
    for _ in range(500):
        little.run()
        classes.run()
    # 2 KiB a run, of which each has some 500 KiB of results and samples
    assert resident() - before < 2000


def test_two_runs_are_under_way_at_once(short):
    # each waits in its first epoch for the other one: with one run after the other, nobody comes
    both = threading.Barrier(2, timeout=60.0)

    def run():
        waited = iter([both.wait])
        short.run(on_epoch=lambda epoch: next(waited, lambda: None)())

    threads = [threading.Thread(target=run) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not both.broken


def test_a_frame_takes_no_memory_beside_the_columns(short):
    if not sys.platform.startswith("linux"):
        pytest.skip("the memory of a process is read from /proc")
    run = short.set("estimator.stop", "600 s").run()
    size = sum(column.nbytes for column in run.columns.values())
    pandas.DataFrame(short.run().columns, copy=False)
    before = resident()
    frame = pandas.DataFrame(run.columns, copy=False)
    assert frame.shape == (run.time.size, len(run.columns))
    assert (resident() - before) * 1024 < 0.25 * size


def test_figures_have_a_panel_for_each_number(run):
    figure = run.plot("track", "dvl.scale", "ins.velocity", "dvl")
    assert len(figure.axes) == 1 + 1 + 3 + 3
    assert "consistent" in figure.get_suptitle()
    assert len(run.plot().axes) > 15
    with pytest.raises(KeyError, match="no state or sensor 'sonar'.*track.*dvl"):
        run.plot("sonar")
