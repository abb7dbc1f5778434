# %% [markdown]
# # Calibrate a DVL
# The filter determines scale factor and misalignment while the vehicle manoeuvres; the smoother
# uses later samples too; the Cramer-Rao bound is the best that any method can reach.

# %%
import navfuse

scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART).set("estimator.stop", "250 s")
filtered, smoothed = scenario.run(), scenario.smooth()
for name in ("dvl.scale", "dvl.misalignment"):
    state = filtered[name]
    for k, component in enumerate(state.components):
        start, end = state.sigma[0, k], state.sigma[-1, k]
        print(f"{name}.{component}: sigma {start:.4g} -> {end:.4g} {state.unit}")
assert (smoothed["dvl.scale"].sigma[0] <= filtered["dvl.scale"].sigma[0]).all()

# %% [markdown]
# How often did the measurements halve the sigma of each state?

# %%
report = scenario.observability()
{state["title"]: round(state["bits"], 1) for state in report["states"]}

# %%
bound = scenario.bound()
bound["points"][0]["states"][0]
