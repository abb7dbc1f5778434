"""Reads the exports of a log with readers written by others, and compares them with the table in CSV.

Usage: foreign.py LOG, beside which the exports are.
"""

import datetime
import pathlib
import sys

import fastkml
import geojson
import gpxpy
import numpy as np
import pandas
import pynmea2
from evo.tools import file_interface
from pygeoif.geometry import LineString

log = pathlib.Path(sys.argv[1])
ORIGIN = datetime.datetime(2026, 6, 1, 8, tzinfo=datetime.timezone.utc)
table = pandas.read_csv(log.with_suffix(".csv"))


def columns(*names):
    return table[list(names)].to_numpy()


time = table["time_s"].to_numpy()
place = columns("ins.position.longitude_deg", "ins.position.latitude_deg", "ins.position.height_m")
velocity = columns("ins.velocity.north_mps", "ins.velocity.east_mps", "ins.velocity.down_mps")
angles = columns("ins.attitude.roll_deg", "ins.attitude.pitch_deg", "ins.attitude.yaw_deg")


def close(found, expected, tolerance, what):
    found, expected = np.asarray(found, float), np.asarray(expected, float)
    assert found.shape == expected.shape, f"{what}: {found.shape}, {expected.shape}"
    worst = np.abs(found - expected).max()
    assert worst <= tolerance, f"{what}: {worst}"


def matrices(roll, pitch, yaw):
    """C_b^n from roll, pitch and yaw, rad (Groves eq. 2.22)."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    rows = [
        [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
        [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
        [-sp, sr * cp, cr * cp],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


c_b_n = matrices(*np.radians(angles).T)

# Parquet: the same numbers as CSV, to the bit
parquet = pandas.read_parquet(log.with_suffix(".parquet"))
assert list(parquet.columns) == list(table.columns)
assert np.array_equal(parquet.to_numpy(), pandas.read_csv(log.with_suffix(".csv"), float_precision="round_trip").to_numpy(), equal_nan=True)
print("parquet agrees")

# GeoJSON: nine decimals of a degree, four of a metre
collection = geojson.loads(log.with_suffix(".geojson").read_text())
assert collection.is_valid, collection.errors()
lines = [f for f in collection.features if f.geometry.type == "LineString"]
points = [f for f in collection.features if f.geometry.type == "Point"]
for found in ([c for line in lines for c in line.geometry.coordinates], [p.geometry.coordinates for p in points]):
    # the package keeps six decimals unless it is asked for more
    close(found, place, 1e-4, "GeoJSON")
close([p.properties["yaw_deg"] for p in points], angles[:, 2], 5e-7, "yaw in GeoJSON")
close([p.properties["north_sigma_m"] for p in points], table["ins.position.north_sigma_m"], 5e-7, "sigma in GeoJSON")
print("geojson agrees")

# KML
kml = fastkml.KML.parse(log.with_suffix(".kml"))
placemarks = list(fastkml.utils.find_all(kml, of_type=fastkml.Placemark))
assert all(isinstance(p.geometry, LineString) for p in placemarks)
close([c for p in placemarks for c in p.geometry.coords], place, 1e-4, "KML")
print("kml agrees")

# GPX
segments = gpxpy.parse(log.with_suffix(".gpx").read_text()).tracks[0].segments
fixes = [p for s in segments for p in s.points]
close([(p.longitude, p.latitude) for p in fixes], place[:, :2], 1e-9, "GPX")
close([p.elevation for p in fixes], place[:, 2], 1e-4, "elevation in GPX")
close([(p.time - ORIGIN).total_seconds() for p in fixes], time, 1e-3, "time in GPX")
print("gpx agrees")

# NMEA: 1e-7 minutes, four decimals of a degree
sentences = [pynmea2.parse(line, check=True) for line in log.with_suffix(".nmea").read_text().split()]
of = {kind: [s for s in sentences if type(s).__name__ == kind] for kind in ("GGA", "GST", "RMC", "HDT", "ZDA")}
assert all(len(of[kind]) == len(time) for kind in of), {k: len(v) for k, v in of.items()}
for kind in ("GGA", "RMC"):
    close([(s.longitude, s.latitude) for s in of[kind]], place[:, :2], 1e-8 / 6 + 1e-12, f"place in {kind}")
close([s.altitude for s in of["GGA"]], place[:, 2], 1e-4, "altitude")
stamps = [datetime.datetime.combine(ORIGIN.date(), s.timestamp) for s in of["GGA"]]
# pynmea2 has times with or without a zone, depending on its version
stamps = [s.replace(tzinfo=datetime.timezone.utc) for s in stamps]
close([(s - ORIGIN).total_seconds() for s in stamps], time, 1e-6, "time of the day")
close([(s.datetime.replace(tzinfo=datetime.timezone.utc) - ORIGIN).total_seconds() for s in of["RMC"]], time, 1e-6, "date")
close([s.spd_over_grnd for s in of["RMC"]], np.hypot(velocity[:, 0], velocity[:, 1]) * 3600 / 1852, 1e-5, "speed")
close([float(s.heading) for s in of["HDT"]], angles[:, 2] % 360, 1e-4, "heading")
sigma = ["ins.position.north_sigma_m", "ins.position.east_sigma_m", "ins.position.down_sigma_m"]
close([(s.std_dev_latitude, s.std_dev_longitude, s.std_dev_altitude) for s in of["GST"]], columns(*sigma), 1e-4, "GST")
print("nmea agrees")

# TUM and KITTI: evo reads them and finds rotations
enu_ned = np.array([[0, 1, 0], [1, 0, 0], [0, 0, -1]])
first = file_interface.read_tum_trajectory_file(str(log.with_suffix(".tum")))
up = file_interface.read_tum_trajectory_file(str(log.with_name("enu.tum")))
kitti = file_interface.read_kitti_poses_file(str(log.with_suffix(".kitti.txt")))
for trajectory in (first, up, kitti):
    valid, why = trajectory.check()
    assert valid, why
close(first.timestamps, time, 1e-9, "TUM times")
close([p[:3, :3] for p in first.poses_se3], c_b_n, 1e-11, "TUM attitude")
close([p[:3, :3] for p in kitti.poses_se3], c_b_n, 1e-11, "KITTI attitude")
close(kitti.positions_xyz, first.positions_xyz, 1e-6, "KITTI positions")
close(up.positions_xyz, first.positions_xyz @ enu_ned.T, 1e-12, "TUM east, north, up")
close([p[:3, :3] for p in up.poses_se3], enu_ned @ c_b_n @ np.diag([1, -1, -1]), 1e-11, "TUM attitude, east, north, up")
# along the meridian and the parallel on WGS 84, for a track of some hundred metres
latitude = np.radians(place[0, 1])
w2 = 1 - 6.69437999014e-3 * np.sin(latitude) ** 2
north = 6378137 * (1 - 6.69437999014e-3) / w2**1.5 + place[0, 2]
east = (6378137 / np.sqrt(w2) + place[0, 2]) * np.cos(latitude)
moved = np.radians(place[:, :2] - place[0, :2])
local = np.column_stack([moved[:, 1] * north, moved[:, 0] * east, place[0, 2] - place[:, 2]])
close(first.positions_xyz, local, 2e-6, "TUM positions")
print("tum agrees")
print("kitti agrees")

# SBET, by the layout of its records as Applanix documents them
names = "time lat lon alt vx vy vz roll pitch heading wander ax ay az wx wy wz".split()
sbet = np.fromfile(log.with_suffix(".sbet"), dtype=[(n, "<f8") for n in names])
monday = 86400 + 8 * 3600 + 18
close(sbet["time"], monday + time, 1e-6, "seconds of the week")
close(np.degrees(np.column_stack([sbet["lon"], sbet["lat"]])), place[:, :2], 1e-12, "place in SBET")
close(np.column_stack([sbet["vx"], sbet["vy"], sbet["vz"]]), velocity, 1e-12, "velocity in SBET")
close(np.degrees(np.column_stack([sbet["roll"], sbet["pitch"], sbet["heading"]])), angles, 1e-12, "attitude in SBET")
steps = np.einsum("kji,kj->ki", c_b_n[1:], np.diff(velocity, axis=0) / np.diff(time)[:, None])
close(np.column_stack([sbet["ax"], sbet["ay"], sbet["az"]])[1:], steps, 1e-9, "acceleration in SBET")
accuracy = np.fromfile(log.with_suffix(".smrmsg"), "<f8").reshape(-1, 10)
close(accuracy[:, 0], sbet["time"], 0, "times of the accuracies")
close(accuracy[:, 1:4], columns(*sigma), 1e-12, "accuracy of the position")
roll_sigma = ["ins.attitude.roll_sigma_deg", "ins.attitude.pitch_sigma_deg", "ins.attitude.yaw_sigma_deg"]
close(accuracy[:, 7:] / 60, columns(*roll_sigma), 1e-12, "accuracy of the attitude")
print("sbet agrees")
