"""The page about Python: every block of it runs."""

import re
from types import SimpleNamespace

import numpy as np
import pandas
from conftest import SCENARIOS
from test_samples import arrivals

import navfuse

PAGE = SCENARIOS.parent / "docs/src/how-to/python.md"


def test_every_block_of_the_page_runs(short, tmp_path, monkeypatch):
    short.set("sink.rerun.enabled", False).run(out=tmp_path)
    log = navfuse.read_log(tmp_path / "run.mcap")
    early = [sample for sample in arrivals(log) if sample[1] <= 65.0]
    imu = [sample for sample in arrivals(log) if sample[0] == "imu" and 65.0 < sample[1] <= 65.2]

    def session(scenario):
        """A session that has begun."""
        begun = navfuse.Session(scenario)
        for sample in early:
            begun.push(*sample)
        return begun

    given = {
        "navfuse": SimpleNamespace(**vars(navfuse) | {"Session": session}),
        "np": np,
        "pandas": pandas,
        "polars": SimpleNamespace(DataFrame=dict),
        "times": np.array([sample[1] for sample in imu]),
        "rates_and_forces": np.array([sample[2] for sample in imu]),
        "time": 65.2,
        "velocity": np.array([0.5, 0.0, 0.0]),
        **log.samples,
    }
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert len(blocks) >= 7
    made = {}
    for block in blocks:
        names = given | made
        exec(block, names)
        made |= {name: names[name] for name in ("scenario", "run") if name in names}
    assert made["run"].time.size > 0
