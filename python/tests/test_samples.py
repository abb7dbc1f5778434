"""Samples in memory, sessions, iterators and sinks: the same numbers as from files, to the bit."""

from pathlib import Path

import numpy as np
import pandas
import pyarrow
import pytest

import navfuse


@pytest.fixture(scope="session")
def recorded(short, tmp_path_factory):
    """A run, and its log as it was recorded."""
    folder = tmp_path_factory.mktemp("recorded")
    run = short.set("sink.rerun.enabled", False).run(out=folder)
    return run, navfuse.read_log(folder / "run.mcap")


def same(a, b):
    """Whether two runs have the same estimates, to the bit."""
    return all(np.array_equal(a.columns[h], b.columns[h], equal_nan=True) for h in b.columns)


def arrivals(log):
    """All samples of a log in order of time, each as the sensor, its time and its channels."""
    tables = {name: np.column_stack(list(t.values())) for name, t in log.samples.items()}
    rows = ((row[0], k, name, row[1:]) for k, (name, t) in enumerate(tables.items()) for row in t)
    return [(name, time, values) for time, _, name, values in sorted(rows, key=lambda r: r[:2])]


def test_a_log_has_the_run_as_it_was_recorded(recorded):
    run, log = recorded
    assert same(run, log) and list(run) == list(log)
    assert same(navfuse.read_log(Path(run.paths["mcap"]).parent), log)
    assert log.verdict == run.verdict and log.findings == run.findings
    assert (log.innovations["dvl"].outcome == run.innovations["dvl"].outcome).all()
    assert np.array_equal(log.innovations["dvl"].nis, run.innovations["dvl"].nis, equal_nan=True)
    assert repr(log).splitlines()[1:] == repr(run).splitlines()[1:]


def test_tables_in_memory_give_the_run_of_the_recording(recorded, short):
    run, log = recorded
    again = short.with_samples(**log.samples).run()
    assert same(run, again)
    assert again.summary["seed"] is None  # a recording has none


def test_tables_of_any_kind_are_taken(recorded, short):
    run, log = recorded
    samples = dict(log.samples)
    depth = samples.pop("depth")
    array = np.column_stack(list(depth.values()))
    named = np.rec.fromarrays(list(depth.values()), names="time_s,depth_m")
    nanos = {"time_ns": np.round(depth["time_s"] * 1e9).astype(np.int64), "depth": depth["depth_m"]}
    for table in (array, named, nanos):
        assert same(run, short.with_samples(depth=table, **samples).run())
    coarse = {"time_ms": depth["time_s"] * 1e3, "depth_cm": depth["depth_m"] * 100.0}
    coarse = short.with_samples(depth=coarse, **samples).run()
    assert np.allclose(coarse["ins.position"].estimate, run["ins.position"].estimate, atol=1e-9)


def test_frames_are_taken_and_given_without_a_copy(recorded, short):
    run, log = recorded
    frames = {name: pandas.DataFrame(table) for name, table in log.samples.items()}
    frames["depth"] = frames["depth"].set_index("time_s")
    frames["dvl"] = pyarrow.table(log.samples["dvl"])
    assert same(run, short.with_samples(**frames).run())
    frame = pandas.DataFrame(run.columns, copy=False)
    assert np.shares_memory(frame["dvl.scale.k"].to_numpy(), run.columns["dvl.scale.k"])
    table = pyarrow.RecordBatchReader.from_stream(run).read_all()
    assert table.column_names == list(run.columns)
    assert np.shares_memory(table["dvl.scale.k"].chunk(0).to_numpy(), run.columns["dvl.scale.k"])


def test_polars_takes_the_columns_without_a_copy(run):
    polars = pytest.importorskip("polars")
    frame = polars.DataFrame(run.columns)
    assert frame.columns == list(run.columns)
    scale = frame["dvl.scale.k"].to_numpy(allow_copy=False)
    assert np.shares_memory(scale, run.columns["dvl.scale.k"])


def test_times_of_a_frame_are_dates_or_a_named_index(recorded, short):
    run, log = recorded
    frame = pandas.DataFrame(log.samples["depth"])
    dates = pandas.to_datetime(np.round(frame.time_s * 1e9).astype(np.int64), unit="ns", utc=True)
    millis = frame.assign(time_ms=np.round(frame.time_s * 1e3).astype(np.int64))
    tables = [
        frame.assign(time=dates).drop(columns="time_s"),
        frame.drop(columns="time_s").set_index(pandas.DatetimeIndex(dates)),
        millis.drop(columns="time_s").set_index("time_ms"),
    ]
    for table in tables:
        again = short.with_samples(**dict(log.samples) | {"depth": table}).run()
        assert again.innovations["depth"].time.tolist() == run.innovations["depth"].time.tolist()


def test_a_column_that_fits_no_channel_is_named_if_a_channel_lacks_one(recorded, short, recwarn):
    _, log = recorded
    dvl = pandas.DataFrame(log.samples["dvl"])
    short.with_samples(dvl=dvl.assign(quality=1.0, vel_x_flag="A"), imu=log.samples["imu"])
    short.with_samples(dvl=dvl.drop(columns="vel_x_mps"))
    assert not recwarn.list
    with pytest.warns(UserWarning, match=r"no column for vel_x \(m/s\).*vel_x_kg"):
        short.with_samples(dvl=dvl.rename(columns={"vel_x_mps": "vel_x_kg"}))


def test_foreign_headings_are_recognised_as_by_import_and_reported(recorded, short):
    run, log = recorded
    imu, dvl = (pandas.DataFrame(log.samples[name]) for name in ("imu", "dvl"))
    force = imu.filter(like="accel")
    foreign = {
        "Time [ms]": imu["time_s"] * 1e3,
        **{f"gyro_{a} (deg/s)": np.degrees(imu[f"gyro_{a}_radps"]) for a in "xyz"},
        **{f"ACC {a.upper()} [m/s^2]": force[f"accel_{a}_mps2"] for a in "xyz"},
        "Temp": 20.0 + 0.0 * imu["time_s"],
    }
    knots = {f"Velocity {a.upper()} (kn)": dvl[f"vel_{a}_mps"] / (1852.0 / 3600.0) for a in "xyz"}
    tables = dict(log.samples) | {
        "imu": pandas.DataFrame(foreign),
        "dvl": pandas.DataFrame(knots).set_index(dvl["time_s"].rename("time")),
    }
    with pytest.warns(UserWarning) as warned:
        again = short.with_samples(**tables).run()
    imu_text, dvl_text = (str(w.message) for w in warned)
    assert 'columns.accel_x = { column = "ACC X [m/s^2]", unit = "m/s^2" }' in imu_text
    assert 'columns.gyro_z = { column = "gyro_z (deg/s)", unit = "deg/s" }' in imu_text
    assert "sensor.imu" in imu_text and "sensor.dvl" in dvl_text and 'unit = "kn"' in dvl_text
    # numbers in other units differ from those in SI by rounding alone
    assert again.time.size == run.time.size
    for name in ("ins.position", "ins.velocity", "ins.attitude"):
        assert np.allclose(again[name].estimate, run[name].estimate, rtol=1e-9, atol=1e-6), name


def test_a_unit_that_no_heading_states_is_found_by_the_numbers(recorded, short):
    run, log = recorded
    imu = log.samples["imu"]
    table = {"t": imu["time_s"], **{f"w{a}": imu[f"gyro_{a}_radps"] for a in "xyz"}}
    table |= {f"a{a}": imu[f"accel_{a}_mps2"] / 9.80665 for a in "xyz"}
    with pytest.warns(UserWarning, match=r"the unit of the specific force: g is shown"):
        again = short.with_samples(**dict(log.samples) | {"imu": table}).run()
    assert np.allclose(again["ins.position"].estimate, run["ins.position"].estimate, atol=1e-6)


def test_a_table_that_does_not_fit_is_an_exception_with_the_columns_that_are_wanted(short):
    time = np.arange(3.0)
    with pytest.raises(navfuse.DataError, match="no column for vel_x.*vel_x_mps.*speed"):
        short.with_samples(dvl={"time_s": time, "speed": time})
    with pytest.raises(navfuse.DataError, match="no .sensor.sonar.*dvl"):
        short.with_samples(sonar={"time_s": time, "range": time})
    with pytest.raises(ValueError, match="time_s"):
        short.with_samples(dvl={"vel_x_mps": time})
    with pytest.raises(ValueError, match="shape"):
        short.with_samples(dvl=np.zeros((3, 9)))
    with pytest.raises(ValueError, match=r"sensor.depth.*time_s.*flag"):
        short.with_samples(depth=pandas.DataFrame({"flag": [1.0, 0.0, 1.0], "depth_m": 0.0 * time}))
    with pytest.warns(UserWarning, match="the column when is taken for the time"):
        short.with_samples(depth=pandas.DataFrame({"when": time, "depth_m": 0.0 * time}))
    # rows from the newest to the oldest are read in the other order
    short.with_samples(depth={"time_s": time[::-1], "depth_m": time})
    with pytest.raises(ValueError, match="depth_m has no numbers.*deep"):
        short.with_samples(depth={"time_s": time, "depth_m": ["deep"] * 3})
    with pytest.raises(navfuse.DataError, match="finite"):
        short.with_samples(depth=np.full((3, 2), np.nan))


def test_an_iterator_is_a_source_and_its_exception_ends_the_run(recorded, short):
    run, log = recorded
    samples = arrivals(log)
    assert same(run, short.with_samples(samples).run())

    def broken():
        yield from samples[:100]
        raise LookupError("the bus is silent")

    with pytest.raises(LookupError, match="bus"):
        short.with_samples(broken()).run()
    with pytest.raises(navfuse.DataError, match="no sensor .sonar"):
        short.with_samples([("sonar", 1.0, [2.0])]).run()


def test_a_function_is_a_sink_and_its_exception_ends_the_run(short, run):
    epochs = []
    short.run(on_epoch=epochs.append)
    assert [e.time for e in epochs] == run.time.tolist()
    assert (epochs[-1]["ins.velocity"].sigma == run["ins.velocity"].sigma[-1]).all()
    assert epochs[-1]["ins.attitude"].quaternion.shape == (4,)

    def fails(epoch):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        short.run(on_epoch=fails)


def test_a_session_has_the_numbers_of_the_run(recorded, short):
    run, log = recorded
    session = navfuse.Session(short)
    assert session.newest() is None
    for sensor, time, values in arrivals(log):
        session.push(sensor, time, values)
    newest = session.newest()
    assert (newest["ins.velocity"].estimate == run["ins.velocity"].estimate[-1]).all()
    assert session.verdict.level in ("consistent", "doubtful")
    finished = session.finish()
    assert same(run, finished) and finished.verdict == run.verdict
    with pytest.raises(ValueError, match="finished"):
        session.newest()


def test_a_block_of_rows_is_pushed_at_once(recorded, short):
    _, log = recorded
    samples = arrivals(log)
    row, block = navfuse.Session(short), navfuse.Session(short)
    for sample in (s for s in samples if s[1] <= 65.0):
        row.push(*sample)
        block.push(*sample)
    later = [s for s in samples if s[0] == "imu" and s[1] > 65.0][:500]
    for sample in later:
        row.push(*sample)
    block.push("imu", [s[1] for s in later], [s[2] for s in later])
    a, b = row.newest(), block.newest()
    assert a.time == later[-1][1] == b.time and same(a, b)


def test_a_session_goes_on_from_its_checkpoint_to_the_same_bits(recorded, short):
    _, log = recorded
    samples = arrivals(log)
    whole = navfuse.Session(short)
    for k, sample in enumerate(samples):
        if k == len(samples) // 2:
            saved = whole.checkpoint()
        whole.push(*sample)
    resumed = navfuse.Session(short, resume=saved)
    for sample in samples[len(samples) // 2 :]:
        resumed.push(*sample)
    assert same(whole.newest(), resumed.newest())
    assert whole.finish().verdict == resumed.finish().verdict


def test_a_checkpoint_that_does_not_fit_is_an_exception(short):
    saved = navfuse.Session(short).checkpoint()
    with pytest.raises(navfuse.NavfuseError, match="cut off"):
        navfuse.Session(short, resume=saved[:-1])
    with pytest.raises(navfuse.NavfuseError, match="no checkpoint"):
        navfuse.Session(short, resume=b"no checkpoint at all")
    other = short.set("sensor.dvl.bias", {"sigma": "1 cm/s"})
    with pytest.raises(navfuse.NavfuseError, match="another scenario"):
        navfuse.Session(other, resume=saved)


def test_what_a_session_cannot_take_is_an_exception(short):
    session = navfuse.Session(short)
    with pytest.raises(ValueError, match="no sensor .sonar"):
        session.push("sonar", 1.0, [1.0])
    with pytest.raises(ValueError, match=r"dvl: .* \(1,\); .*\(3,\) is needed, of vel_x"):
        session.push("dvl", 1.0, [1.0])
    with pytest.raises(ValueError, match=r"\(6, 2\); \(2, 6\) is needed"):
        session.push("imu", [1.0, 1.01], np.zeros((6, 2)))
    session.push("depth", 1.0, 12.3)
    session.push("depth", [1.5, 2.0], [12.3, 12.4])
    with pytest.raises(navfuse.DataError, match="73 years"):
        session.push("depth", 1e12, [1.0])
