"""Counts, for each hundred of a campaign of 1000 runs, the epochs from 700 s on at which its ANEES leaves the 95 % band
of 100 runs of 19 states."""
import polars as pl

runs = pl.read_parquet("runs/pan-wu-3d-monte-carlo/runs.parquet", columns=["run", "time_s", "nees"])
hundred = ((pl.col("run") - 1) // 100).alias("hundred")
anees = runs.filter(pl.col("time_s") >= 700).group_by(hundred, "time_s").agg(pl.col("nees").mean())
outside = (~pl.col("nees").is_between(17.8109, 20.2270)).sum().alias("epochs outside")
print(anees.group_by("hundred").agg(outside, pl.len().alias("of")).sort("hundred"))
