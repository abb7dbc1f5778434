import polars as pl

runs = pl.read_parquet("runs/pan-wu-3d-monte-carlo/runs.parquet")
ratio = (pl.col("dvl.scale.k.error") / pl.col("dvl.scale.k.sigma")).pow(2).mean().sqrt()
by_time = runs.group_by("epoch").agg(pl.col("time_s").first(), ratio.alias("rms"))
print(by_time.sort("rms", descending=True).head())
