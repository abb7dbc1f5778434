"""Scenarios: their content, and the exceptions of those that do not fit."""

import os
import subprocess
import sys
import time

import numpy as np
import pytest

import navfuse


def test_a_scenario_never_changes(short):
    before = short.to_toml()
    other = short.set({"seed": 5, "sensor.dvl.noise": "2 cm/s", "sensor.depth.enabled": False})
    assert short.to_toml() == before
    assert "seed = 5" in other.to_toml() and 'noise = "2 cm/s"' in other.to_toml()
    assert other.set("seed=6").to_toml() == other.set("seed", 6).to_toml()
    assert other.set("seed", np.int64(6)).to_toml() == other.set("seed", 6).to_toml()
    lever_arm = {"sensor.dvl.lever_arm": np.array([1.0, 2.0])}
    assert "lever_arm = [1.0, 2.0]" in other.set(lever_arm).to_toml()
    with pytest.raises(TypeError, match="needs a value"):
        other.set("sensor.dvl.noise")


def test_check_names_states_and_sensors(short):
    check = short.check()
    assert {"name": "dvl.scale", "unit": "", "components": ["k"]}.items() <= check.states[5].items()
    dvl = next(s for s in check.sensors if s["name"] == "dvl")
    assert list(dvl["channels"].values()) == ["m/s"] * 3
    assert "dvl.scale" in repr(check) and "dvl.scale" in check._repr_html_()


def test_a_mistake_is_an_exception_with_file_line_key_and_remedy(tmp_path):
    path = tmp_path / "dive.toml"
    text = navfuse.QUICKSTART.replace("gate = 0.999", "gaet = 0.999").replace('"5 cm"', '"5 kg"')
    path.write_text(text)
    with pytest.raises(navfuse.ScenarioError) as caught:
        navfuse.Scenario.load(path).check()
    first = caught.value
    assert (first.file, first.key) == (str(path), "sensor.dvl.gaet")
    assert text.splitlines()[first.line - 1].startswith("gaet")
    assert first.remedy.startswith('did you mean "gate"?') and "^^^^" in first.excerpt
    assert [m.key for m in first.mistakes] == ["sensor.dvl.gaet", "sensor.depth.noise"]
    with pytest.raises(ValueError, match="gaet"):
        navfuse.Scenario.load(path).run()


def test_a_file_that_is_not_there_is_a_data_error(tmp_path):
    with pytest.raises(navfuse.DataError) as caught:
        navfuse.Scenario.load(tmp_path / "absent.toml")
    assert caught.value.file.endswith("absent.toml") and "absent.toml" in str(caught.value)
    with pytest.raises(OSError):
        navfuse.Scenario.load(tmp_path / "absent.mcap")


def test_a_run_that_ends_early_keeps_what_it_has(short):
    with pytest.raises(navfuse.RunError) as caught:
        short.set({"estimator.start": "90 s", "estimator.stop": "80 s"}).run()
    assert caught.value.run.time.size == 0
    assert str(caught.value) == caught.value.run.events[-1].text


def test_the_command_is_inside(tmp_path):
    call = [sys.executable, "-m", "navfuse"]
    text = navfuse.QUICKSTART.replace("[estimator]", '[estimator]\nstop = "70 s"')
    (tmp_path / "q.toml").write_text(text)
    ran = subprocess.run([*call, "run", "q.toml"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0 and "verdict: consistent" in ran.stdout
    assert (tmp_path / "runs/q/run.mcap").exists() and (tmp_path / "runs/q/run.rrd").exists()
    for arguments, code in [(["--version"], 0), (["rnu"], 2), (["run", "absent.toml"], 1)]:
        assert subprocess.run([*call, *arguments], capture_output=True).returncode == code


@pytest.mark.skipif(sys.platform == "win32", reason="the stand-in for the viewer is a script of a shell")
def test_view_opens_the_viewer_that_is_installed_beside_python(short, tmp_path):
    short.set("estimator.stop", "61 s").run(out=tmp_path / "run")
    viewer, opened = tmp_path / "bin/rerun", tmp_path / "opened"
    viewer.parent.mkdir()
    viewer.write_text(f'#!/bin/sh\n[ "$1" = --version ] && echo "rerun-cli 0.36.3" || echo "$@" >{opened}\n')
    viewer.chmod(0o755)
    text = (
        "import sys; from navfuse import __main__ as m\n"
        f"sys.executable, sys.argv = {str(tmp_path / 'bin/python')!r}, ['navfuse', 'view', {str(tmp_path / 'run')!r}]\n"
        "sys.exit(m.main())"
    )
    bare = {"PATH": "/usr/bin:/bin", "PYTHONPATH": os.pathsep.join(sys.path)}
    ran = subprocess.run([sys.executable, "-c", text], env=bare, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    until = time.monotonic() + 20.0
    while not opened.exists() and time.monotonic() < until:  # the command does not wait for the viewer
        time.sleep(0.05)
    assert "run.rrd" in opened.read_text()


def test_the_types_hold():
    for tool in (["mypy", "--strict", "-p", "navfuse"], ["mypy.stubtest", "navfuse._navfuse"]):
        ran = subprocess.run([sys.executable, "-m", *tool], capture_output=True, text=True)
        assert ran.returncode == 0, ran.stdout + ran.stderr


def test_the_examples_of_the_documentation_hold():
    import doctest

    from navfuse import _campaign, _process, _run, _scenario, _sensor, _session

    for module in (navfuse, _campaign, _process, _run, _scenario, _sensor, _session):
        assert doctest.testmod(module).failed == 0
