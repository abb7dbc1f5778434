# %% [markdown]
# # First run
# An underwater vehicle with IMU, DVL and depth sensor, all simulated. No file is needed.

# %%
import navfuse

scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART)
scenario.check()

# %%
run = scenario.run()
run

# %% [markdown]
# Each state has its estimate, its sigma, and its error against the simulated truth.

# %%
scale = run["dvl.scale"]
print(f"scale factor {scale.estimate[-1, 0]:.4f} ± {scale.sigma[-1, 0]:.4f}")

# %%
figure = run.plot("track", "dvl.scale", "ins.velocity")
