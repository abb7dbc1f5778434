"""Reads the tables of campaigns with polars and with pandas, and compares what they say with report.json.

Usage: readers.py CAMPAIGN-FOLDER SWEEP-FOLDER
"""

import json
import math
import pathlib
import sys

import pandas
import polars


class Polars:
    name = "polars"

    def __init__(self, path):
        self.table = polars.read_parquet(path)

    def columns(self):
        return self.table.columns

    def column(self, name):
        return self.table.get_column(name).to_list()

    def last_of_runs(self, point, name):
        """The value at the last epoch of each run of a point."""
        table = self.table.filter(polars.col("point") == point).sort("run", "epoch")
        return table.group_by("run", maintain_order=True).agg(polars.col(name).last()).get_column(name).to_list()


class Pandas:
    name = "pandas"

    def __init__(self, path):
        self.table = pandas.read_parquet(path, engine="pyarrow")

    def columns(self):
        return list(self.table.columns)

    def column(self, name):
        return self.table[name].tolist()

    def last_of_runs(self, point, name):
        table = self.table[self.table["point"] == point].sort_values(["run", "epoch"])
        # not last(), which passes over what is missing
        return table.groupby("run").tail(1)[name].tolist()


def close(found, expected, what):
    """Equal to 1e-12, relative; missing in the report is NaN or absent in a table."""
    if expected is None:
        assert found is None or math.isnan(found), f"{what}: {found} where the report has nothing"
        return
    assert math.isclose(found, expected, rel_tol=1e-12, abs_tol=0), f"{what}: {found} and in the report {expected}"


def mean(values):
    values = [v for v in values if not math.isnan(v)]
    return math.fsum(values) / len(values) if values else None


def root_mean_square(values):
    squares = mean([v * v for v in values])
    return None if squares is None else math.sqrt(squares)


def compare(reader, folder):
    """Compares the report of a campaign in a folder with its tables."""
    report = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    runs, epochs, bounds = (reader(folder / f"{name}.parquet") for name in ("runs", "epochs", "bounds"))
    points = range(len(report["points"]))
    assert sorted(set(runs.column("point"))) == list(points)
    for number in points:
        point = report["points"][number]
        last_epoch = [k for k, p in enumerate(epochs.column("point")) if p == number][-1]
        last_bound = [k for k, p in enumerate(bounds.column("point")) if p == number][-1]
        assert len(runs.last_of_runs(number, "seed")) == point["runs"] == epochs.column("runs")[last_epoch]
        assert set(runs.last_of_runs(number, "time_s")) == {point["end_s"]}
        for state in point["states"]:
            name = f"{state['state']}.{state['component']}"
            errors, sigmas = (runs.last_of_runs(number, f"{name}.{what}") for what in ("error", "sigma"))
            close(root_mean_square(errors), state["rmse"], f"{name} rmse")
            close(mean(errors), state["mean_error"], f"{name} mean error")
            close(root_mean_square(sigmas), state["sigma"], f"{name} sigma")
            for what in ("rmse", "mean_error", "sigma", "bound"):
                close(epochs.column(f"{name}.{what}")[last_epoch], state[what], f"{name} {what} in epochs")
            close(bounds.column(f"{name}.bound")[last_bound], state["bound"], f"{name} bound")
        for anees in point["anees"]:
            whole = anees["of"] == "whole state"
            nees = runs.last_of_runs(number, "nees" if whole else f"{anees['of']}.nees")
            close(mean(nees), anees["value"], f"{anees['of']} ANEES")
            column = "anees" if whole else f"{anees['of']}.anees"
            close(epochs.column(column)[last_epoch], anees["value"], f"{anees['of']} ANEES in epochs")
        for nis in point["nis"]:
            mine = [k for k, p in enumerate(runs.column("point")) if p == number]
            used, total, expected = (
                math.fsum(runs.column(f"{nis['sensor']}.{what}")[k] for k in mine)
                for what in ("used", "nis_sum", "nis_expected")
            )
            assert used == nis["used"]
            close(total / used, nis["mean"], f"{nis['sensor']} mean NIS")
            close(expected / used, nis["expected"], f"{nis['sensor']} expected NIS")
    if report["keys"]:
        sweep = reader(folder / "sweep.parquet")
        table = pandas.read_csv(folder / "sweep.csv")
        assert list(table.columns) == sweep.columns()
        for number in points:
            point = report["points"][number]
            assert [sweep.column(key)[number] for key in report["keys"]] == point["values"]
            assert sweep.column("verdict")[number] == point["verdict"]["text"]
            for state in point["states"]:
                for what in ("bound", "smoothed", "rmse", "sigma"):
                    name = f"{state['state']}.{state['component']}.{what}"
                    close(sweep.column(name)[number], state[what], f"{name} in sweep.parquet")
                    close(float(table[name][number]), state[what], f"{name} in sweep.csv")
    print(f"{reader.name}: {folder.name}: the report agrees with its tables")


if __name__ == "__main__":
    for argument in sys.argv[1:]:
        for kind in (Polars, Pandas):
            compare(kind, pathlib.Path(argument))
