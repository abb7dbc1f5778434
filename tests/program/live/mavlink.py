"""Prints the messages of MAVLink in a file, as pymavlink reads them: an array of objects in JSON."""

import json
import math
import os
import sys

os.environ["MAVLINK20"] = "1"
from pymavlink.dialects.v20 import ardupilotmega


def plain(value):
    """A value without NaN, which JSON does not have."""
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return None if isinstance(value, float) and math.isnan(value) else value


with open(sys.argv[1], "rb") as file:
    reader = ardupilotmega.MAVLink(None)
    messages = reader.parse_buffer(file.read()) or []
print(json.dumps([{k: plain(v) for k, v in m.to_dict().items()} | {"sender": [m.get_srcSystem(), m.get_srcComponent()]} for m in messages]))
