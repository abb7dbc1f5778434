"""An autopilot at the end of a serial line: sends its inertial unit, its receiver and its pressure sensor as MAVLink by
pymavlink, and prints the messages of the estimate that it receives, an array of objects in JSON.

    autopilot.py PORT SENTENCES SECONDS
"""

import json
import math
import os
import select
import sys
import termios
import time
import tty

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import ardupilotmega

port = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
tty.setraw(port, termios.TCSANOW)
seconds = float(sys.argv[3])


class Line:
    def write(self, data):
        os.write(port, data)


link = ardupilotmega.MAVLink(Line(), srcSystem=1, srcComponent=1)
received = []


def listen(until):
    while (rest := until - time.monotonic()) > 0:
        if select.select([port], [], [], rest)[0]:
            received.extend(link.parse_buffer(os.read(port, 4096)) or [])


begin, first = time.monotonic(), None
for line in open(sys.argv[2], encoding="ascii"):
    sensor, stamp, *values = line.split("*")[0].split(",")[1:]
    stamp = float(stamp)
    first = stamp if first is None else first
    if stamp - first > seconds:
        break
    listen(begin + stamp - first)
    value = {name: float(number) for name, number in (v.split("=") for v in values)}
    # since the start of the vehicle
    micros = int((100 + stamp) * 1e6)
    if sensor == "imu":
        force = [value[f"accel_{axis}"] for axis in "xyz"]
        rate = [value[f"gyro_{axis}"] for axis in "xyz"]
        link.highres_imu_send(micros, *force, *rate, 0, 0, 0, 0, 0, 0, 20, 63)
    if sensor == "depth":
        pressure = 1013.25 + value["depth"] * 1025 * 9.80665 / 100
        link.scaled_pressure2_send(micros // 1000, pressure, 0.0, 2000)
    if sensor == "gnss":
        place = [round(math.degrees(value[name]) * 1e7) for name in ("lat", "lon")]
        height = round(value["height"] * 1e3)
        unknown = 65535
        link.gps_raw_int_send(micros, 3, *place, height, unknown, unknown, unknown, unknown, 12, alt_ellipsoid=height)
listen(time.monotonic() + 1)


def plain(value):
    """A value without NaN, which JSON does not have."""
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and math.isnan(value) else value


print(json.dumps([{k: plain(v) for k, v in m.to_dict().items()} for m in received]))
