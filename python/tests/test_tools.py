"""The tools: the same reports as of the command."""

import json

import pytest
from conftest import SCENARIOS

import navfuse


@pytest.fixture(scope="module")
def file(short, tmp_path_factory):
    path = tmp_path_factory.mktemp("tools") / "dive.toml"
    path.write_text(short.set({"name": "dive", "estimator.stop": "70 s"}).to_toml())
    return path


def printed(command, *arguments):
    return json.loads(command(*arguments, "--format", "json").stdout)


def test_a_campaign_and_the_bound_are_those_of_the_command(file, command):
    scenario = navfuse.Scenario.load(file)
    ran = printed(command, "monte-carlo", file, "--runs", 3, "--no-output")
    assert scenario.monte_carlo(3) == ran
    assert scenario.monte_carlo(3, jobs=1) == ran
    assert scenario.bound() == printed(command, "bound", file, "--no-output")


def test_observability_is_that_of_the_command(file, command):
    report = navfuse.Scenario.load(file).observability()
    assert report == printed(command, "observability", file)


def test_a_smoothed_run_is_that_of_the_command(file, command):
    run = navfuse.Scenario.load(file).smooth()
    expected = printed(command, "smooth", file, "--no-output")
    assert run.summary["states"] == expected["states"]
    assert run.summary["smoothing"] == expected["smoothing"]


def test_progress_of_a_campaign_counts_runs(file):
    seen = []
    scenario = navfuse.Scenario.load(file).set("estimator.stop", "200 s")
    scenario.monte_carlo(4, jobs=1, progress=lambda done, all: seen.append((done, all)))
    assert seen and all(0 <= done <= all_ for done, all_ in seen)

    def fails(done, all):
        raise LookupError("enough")

    with pytest.raises(LookupError, match="enough"):
        scenario.monte_carlo(50, jobs=1, progress=fails)


def test_a_diagnosis_names_the_change_that_explains_the_samples(file):
    scenario = navfuse.Scenario.load(file).set("estimator.stop", "64 s")
    diagnosis = scenario.diagnose()
    assert diagnosis["tried"] > 10 and diagnosis["unchanged"]["level"] == "consistent"


def test_a_calibration_is_that_of_the_command(command):
    path = SCENARIOS / "pan-wu-3d.toml"
    scenario = navfuse.Scenario.load(path)
    assert scenario.calibrate() == printed(command, "calibrate", path)
    with pytest.raises(navfuse.NavfuseError, match="sideways"):
        scenario.calibrate("sideways")
