"""The examples, whose cells a notebook shows, run."""

import runpy

import matplotlib
import pytest
from conftest import SCENARIOS

matplotlib.use("agg")
EXAMPLES = sorted((SCENARIOS.parent / "python/examples").glob("*.py"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path):
    runpy.run_path(str(path))
