"""Runs of scenarios: the same numbers as the command, to the bit."""

import csv
import json
import re
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from conftest import SCENARIOS

import navfuse


@pytest.mark.parametrize(
    "name, settings",
    [
        ("quickstart", {"estimator.stop": "100 s"}),
        ("surface-dive", {"estimator.stop": "120 s", "seed": 7}),
        ("tactical", {"estimator.stop": "650 s", "estimator.smooth": True}),
        ("laser-land", {"estimator.stop": "700 s"}),
        ("auv", {"estimator.stop": "100 s"}),
    ],
)
def test_a_run_has_the_numbers_of_the_command(name, settings, command):
    path = SCENARIOS / f"{name}.toml"
    run = navfuse.Scenario.load(path).set(settings).run()
    texts = [part for k, v in settings.items() for part in ("--set", f"{k}={json.dumps(v)}")]
    printed = command("run", path, "--no-output", "--format", "json", *texts)
    expected = json.loads(printed.stdout)
    for summary in (expected, run.summary):
        del summary["wall_s"]
    assert run.summary == expected


def first_seconds(path):
    """The settings that end a run ten seconds after its start, unless it begins with an alignment."""
    if path.stem.startswith("alignment"):
        return {}
    start = re.search(r'^start = "([\d.]+) s"', path.read_text(), re.MULTILINE)
    return {"estimator.stop": f"{float(start.group(1) if start else 0.0) + 10.0} s"}


@pytest.mark.parametrize(
    "path", sorted(SCENARIOS.rglob("*.toml")), ids=lambda path: str(path.relative_to(SCENARIOS))
)
def test_every_scenario_has_the_numbers_of_the_command(path, command):
    settings = first_seconds(path)
    texts = [part for k, v in settings.items() for part in ("--set", f"{k}={v}")]
    printed = command("run", path, "--no-output", "--format", "json", *texts)
    try:
        run = navfuse.Scenario.load(path).set(settings).run()
    except navfuse.NavfuseError as error:
        assert " ".join(error.message.split()) in " ".join(printed.stderr.split())
        assert "No such file" in error.message  # a recording that is not there
        return
    expected = json.loads(printed.stdout)
    for summary in (expected, run.summary):
        del summary["wall_s"]
    assert run.summary == expected


def test_columns_are_those_of_the_table_of_a_run(short, run, tmp_path):
    short.set("sink.csv", {"covariance": True}).run(out=tmp_path)
    with open(tmp_path / "estimate.csv", newline="") as file:
        headings, *rows = csv.reader(file)
    assert headings == list(run.columns)
    numbers = np.array([[float(cell or "nan") for cell in row] for row in rows]).T
    assert np.array_equal(numbers, np.array(list(run.columns.values())), equal_nan=True)


def test_states_are_views_of_the_columns_in_printed_units(run):
    velocity = run["ins.velocity"]
    assert velocity.unit == "m/s" and velocity.components == ("north", "east", "down")
    assert velocity.estimate.shape == velocity.sigma.shape == (run.time.size, 3)
    assert np.shares_memory(velocity.estimate, run.columns["ins.velocity.north_mps"])
    assert np.array_equal(velocity.sigma[:, 2], run.columns["ins.velocity.down_sigma_mps"])
    assert run["ins.position"].units == ("deg", "deg", "m")
    assert run["ins.position"].differences == ("north", "east", "down")
    with pytest.raises(ValueError, match="read-only"):
        velocity.estimate[0, 0] = 1.0


def test_the_final_estimate_is_that_of_the_summary(run):
    for name, state in run.items():
        final = run.summary["states"][name]
        assert state.estimate[-1].tolist() == final["estimate"]
        assert state.sigma[-1].tolist() == final["sigma"]
        assert (state.unit, list(state.components)) == (final["unit"], final["components"])


def test_a_quaternion_turns_the_body_into_north_east_down(run):
    w, x, y, z = run["ins.attitude"].quaternion.T
    roll, pitch, yaw = np.radians(run["ins.attitude"].estimate).T
    ahead = np.array([w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y)])
    expected = [np.cos(pitch) * np.cos(yaw), np.cos(pitch) * np.sin(yaw), -np.sin(pitch)]
    assert np.allclose(ahead, expected, atol=1e-14)
    with pytest.raises(TypeError, match="dvl.scale"):
        run["dvl.scale"].quaternion


def test_the_covariance_is_symmetric_and_has_the_sigmas(run):
    names, matrix = run.covariance()
    assert matrix.shape == (len(names), len(names)) and np.array_equal(matrix, matrix.T)
    sigma = np.sqrt(matrix[names.index("ins.velocity.east"), names.index("ins.velocity.east")])
    assert np.isclose(sigma, run["ins.velocity"].sigma[-1, 1], rtol=1e-14)


def test_innovations_are_counted_as_in_the_summary(run):
    dvl = run.innovations["dvl"]
    counts = run.summary["samples"]["dvl"]
    assert dvl.accepted.sum() == counts["accepted"]
    assert (dvl.outcome == "gated").sum() == counts["gated"]
    assert np.isclose(dvl.nis[dvl.accepted].mean(), counts["mean_nis"], rtol=1e-12)
    assert dvl.value.shape == dvl.sigma.shape == (dvl.time.size, len(dvl.channels))
    assert "imu" not in run.innovations and run.innovations.get("imu") is None
    with pytest.raises(KeyError, match="'imu'.*dvl, depth"):
        run.innovations["imu"]


def test_a_run_is_shown_with_its_verdict(run):
    text, page = repr(run), run._repr_html_()
    assert text.splitlines()[-1] == f"verdict: {run.verdict}"
    assert "dvl.scale" in text and "dvl.scale" in page and "<table>" in page


def test_show_opens_the_page_of_a_report(short, run, tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    written = short.set("sink.rerun.enabled", False).run(out=tmp_path)
    written.show()
    navfuse.read_log(written.paths["mcap"]).show()
    for url in opened:
        page = Path(url.removeprefix("file://")).read_text()
        assert "dvl.scale" in page and "consistent" in page
    assert len(opened) == 2
    with pytest.raises(ValueError, match="out=FOLDER"):
        run.show()
    (tmp_path / "run.mcap").write_bytes(b"no log")
    with pytest.raises(navfuse.NavfuseError, match="run.mcap"):
        written.show()


class Notebook:
    """The part of IPython that shows things in a notebook."""

    def __init__(self, monkeypatch):
        self.shown = []
        display = SimpleNamespace(HTML=str, display=self.display)
        module = SimpleNamespace(get_ipython=lambda: SimpleNamespace(kernel=1), display=display)
        monkeypatch.setitem(sys.modules, "IPython", module)
        monkeypatch.setitem(sys.modules, "IPython.display", display)

    def display(self, text, display_id=False):
        self.shown.append(text)
        return SimpleNamespace(update=self.shown.append)


def test_a_notebook_shows_the_page_in_its_cell_and_progress_as_a_bar(short, tmp_path, monkeypatch, capfd):
    notebook = Notebook(monkeypatch)
    run = short.set({"estimator.stop": "400 s", "sink.rerun.enabled": False}).run(out=tmp_path, progress=True)
    assert notebook.shown[0] == ""
    assert notebook.shown[-1].startswith('<progress value="') and "of 400" in notebook.shown[-1]
    run.show()
    assert notebook.shown[-1].startswith('<iframe srcdoc="') and "dvl.scale" in notebook.shown[-1]
    assert capfd.readouterr().err == ""


def test_a_run_writes_only_into_the_folder_that_is_named(short, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    short.run()
    assert not list(tmp_path.iterdir())
    run = short.run(out=tmp_path / "dive")
    assert [p.name for p in tmp_path.iterdir()] == ["dive"]
    assert {"run.mcap", "run.rrd"} <= {p.name for p in (tmp_path / "dive").iterdir()}
    assert run.paths["mcap"].endswith("run.mcap")
    again = navfuse.Scenario.load(tmp_path / "dive" / "run.mcap").run()
    assert again.summary["states"] == run.summary["states"]


def test_progress_comes_while_a_run_goes_on_and_an_exception_in_it_ends_the_run(short):
    seen = []
    whole = short.set("estimator.stop", "600 s")
    whole.run(progress=lambda now, end: seen.append((now, end)))
    assert seen and all(0.0 <= now <= end for now, end in seen)

    def fails(now, end):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        whole.run(progress=fails)
