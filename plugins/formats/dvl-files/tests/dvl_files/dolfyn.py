"""Prints what MHKiT's dolfyn reads from files: one line of numbers for each ping, nan where it has
none, and a line `end` after each file."""
import contextlib
import io
import sys
import warnings

warnings.filterwarnings("ignore")


def table(path):
    with contextlib.redirect_stdout(io.StringIO()):
        ds = dolfyn.read(path)
        teledyne = "vel_bt" not in ds or "prcnt_gd_bt" in ds
        turned = None
        # dolfyn does not turn ship coordinates to those of the instrument
        if teledyne and "vel_bt" in ds and ds.coord_sys != "ship":
            turned = dolfyn.rotate2(ds, "inst", inplace=False)
    tag = "" if teledyne else "_bt"
    n = ds.sizes["time" + tag]

    def rows(dataset, name, count):
        if dataset is None or name not in dataset:
            return np.full((count, n), np.nan)
        return np.asarray(dataset[name].values, dtype=float).reshape(count, n)

    time = ds["time" + tag].values.astype("datetime64[ns]").astype("int64")
    names = ["vel", "dist", "corr", "prcnt_gd", "fom"]
    values = [rows(ds, name + "_bt", 4) for name in names] + [rows(turned, "vel_bt", 4)]
    values += [rows(ds, name + tag, 1) for name in ["heading", "pitch", "roll", "c_sound"]]
    values += [rows(ds, "depth", 1)]
    return time, np.vstack(values)


with contextlib.redirect_stdout(io.StringIO()):
    import numpy as np
    import mhkit.dolfyn as dolfyn

for path in sys.argv[1:]:
    time, values = table(path)
    for k, t in enumerate(time):
        print(t, *(repr(float(x)) for x in values[:, k]))
    print("end")
