# %% [markdown]
# # Samples of one's own
# The samples are in tables, here those of a simulated run; a program reads its files into them.

# %%
import tempfile
from pathlib import Path

import numpy as np

import navfuse

scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART)
with tempfile.TemporaryDirectory() as folder:
    scenario.set("sink.rerun.enabled", False).run(out=folder)
    tables = navfuse.read_log(Path(folder) / "run.mcap").samples
{name: list(table) for name, table in tables.items()}

# %% [markdown]
# The DVL of this recording counts in cm/s, and loses the bottom for a minute.

# %%
dvl = tables["dvl"]
kept = (dvl["time_s"] < 300.0) | (dvl["time_s"] > 360.0)
tables["dvl"] = {
    "time_s": dvl["time_s"][kept],
    **{f"vel_{axis}_cmps": 100.0 * dvl[f"vel_{axis}_mps"][kept] for axis in "xyz"},
}
run = scenario.with_samples(**tables).run()
run

# %%
sigma = run["ins.velocity"].sigma[:, 0]
during = sigma[(run.time > 300.0) & (run.time < 360.0)].max()
print(f"1-sigma of the velocity north: {np.median(sigma):.4f} m/s, up to {during:.4f} m/s without bottom")
assert run.verdict.level == "consistent"
