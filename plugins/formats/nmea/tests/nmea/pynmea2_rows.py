"""Prints the numbers of each sentence of a file as pynmea2 reads them; nan where there is none."""

import datetime
import sys

import pynmea2

NONE = float("nan")


def number(value):
    return NONE if value in (None, "") else float(value)


def seconds(time):
    if not time:
        return NONE
    return time.hour * 3600 + time.minute * 60 + time.second + time.microsecond * 1e-6


def days(date):
    return (date - datetime.date(1970, 1, 1)).days if date else NONE


def place(m):
    return [m.latitude, m.longitude] if m.lat and m.lon else [NONE, NONE]


def motion(speed, course):
    """Speed and course; a course is needed unless the speed is zero."""
    speed, course = number(speed), number(course)
    if course == course:
        return [speed, course]
    return [0.0, 0.0] if speed == 0 else [NONE, NONE]


def east(degrees, direction):
    return number(degrees) * (-1 if direction == "W" else 1)


def row(m, line):
    kind = type(m).__name__
    if kind == "GGA":
        height = number(m.altitude)
        separation = number(m.geo_sep)
        height += separation if separation == separation else 0
        return [seconds(m.timestamp), *place(m), height, m.gps_qual]
    if kind == "RMC":
        velocity = motion(m.spd_over_grnd, m.true_course)
        return [seconds(m.timestamp), days(m.datestamp), *place(m), *velocity, m.status == "A"]
    if kind == "VTG":
        return motion(m.spd_over_grnd_kts, m.true_track)
    if kind == "GST":
        return [seconds(m.timestamp), m.std_dev_latitude, m.std_dev_longitude, m.std_dev_altitude]
    if kind == "ZDA":
        # pynmea2 has no leap second: the time of the day is that of the text
        text = line.split(",")[1]
        time = int(text[:2]) * 3600 + int(text[2:4]) * 60 + float(text[4:])
        return [time, days(datetime.date(m.year, m.month, m.day))]
    if kind == "HDT":
        return [m.heading]
    if kind == "HDG":
        deviation, variation = east(m.deviation, m.dev_dir), east(m.variation, m.var_dir)
        return [float(m.heading) + (deviation if deviation == deviation else 0), variation]
    if kind == "HDM":
        return [m.heading, NONE]
    if kind == "SXN20":
        return [int(q) < 2 for q in (m.horiz_qual, m.hgt_qual, m.head_qual, m.rp_qual)]
    if kind == "DPT":
        offset = number(m.offset)
        return [float(m.depth) + (offset if offset == offset else 0)]
    if kind == "ASHRATT":
        return [seconds(m.timestamp), m.roll, m.pitch, m.true_heading]
    if kind == "SXN23":
        return [NONE, m.roll, m.pitch, m.head]
    raise SystemExit(f"no row for {kind}")


for line in open(sys.argv[1], newline="\r\n"):
    print(*(repr(float(n)) for n in row(pynmea2.parse(line.strip(), check=True), line)))
