"""Prints what MHKiT's dolfyn reads: one line of numbers for each ping, nan where it has none."""
import contextlib
import io
import sys
import warnings

warnings.filterwarnings("ignore")
with contextlib.redirect_stdout(io.StringIO()):
    import numpy as np
    import mhkit.dolfyn as dolfyn

    ds = dolfyn.read(sys.argv[1])
    teledyne = "vel_bt" not in ds or "prcnt_gd_bt" in ds
    turned = None
    # dolfyn does not turn ship coordinates to those of the instrument
    if teledyne and "vel_bt" in ds and ds.coord_sys != "ship":
        turned = dolfyn.rotate2(ds, "inst", inplace=False)
n = ds.sizes["time_bt" if not teledyne else "time"]


def rows(dataset, name, count):
    if dataset is None or name not in dataset:
        return np.full((count, n), np.nan)
    return np.asarray(dataset[name].values, dtype=float).reshape(count, n)


tag = "" if teledyne else "_bt"
time = ds["time" + tag].values.astype("datetime64[ns]").astype("int64")
table = np.vstack(
    [
        rows(ds, "vel_bt", 4),
        rows(turned, "vel_bt", 4),
        rows(ds, "dist_bt", 4),
        rows(ds, "corr_bt", 4),
        rows(ds, "prcnt_gd_bt", 4),
        rows(ds, "heading" + tag, 1),
        rows(ds, "pitch" + tag, 1),
        rows(ds, "roll" + tag, 1),
        rows(ds, "c_sound" + tag, 1),
        rows(ds, "depth", 1),
        rows(ds, "fom_bt", 4),
    ]
)
for k in range(n):
    print(time[k], *(repr(float(x)) for x in table[:, k]))
