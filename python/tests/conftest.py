"""Scenarios that the tests share."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import navfuse

SCENARIOS = Path(__file__).parent.parent.parent / "scenarios"


@pytest.fixture(scope="session")
def short():
    """The quick start, of which 40 s are filtered."""
    return navfuse.Scenario.from_toml(navfuse.QUICKSTART).set("estimator.stop", "100 s")


@pytest.fixture(scope="session")
def run(short):
    """Its run, with the covariance."""
    return short.run(covariance=True)


@pytest.fixture(scope="session")
def command():
    """Calls the command that Cargo built, or else the one of the wheel."""
    program = os.environ.get("NAVFUSE", "")
    program = program if os.path.isfile(program) else shutil.which("navfuse")

    def call(*arguments):
        return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)

    return call
