"""Prints each field of each message of a log as pyulog or pymavlink reads it: one line with the name of
the message, its instance, the name of the field, and all its values."""

import sys

kind, path = sys.argv[1:]
if kind == "ulog":
    from pyulog import ULog

    log = ULog(path)
    for topic in log.data_list:
        for field, values in topic.data.items():
            print(topic.name, topic.multi_id, field, *(repr(float(v)) for v in values))
    print("dropouts", 0, "duration", *(d.duration for d in log.dropouts))
else:
    import os

    os.environ["MAVLINK20"] = "1"
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(path, dialect="all")
    rows = {}
    while (m := log.recv_match()) is not None:
        if m.get_type() == "BAD_DATA":
            raise SystemExit("bad data")
        # a definition of a format has texts
        if m.get_type() == "FMT":
            continue
        key = (m.get_type(), getattr(m, "I", 0) if kind == "dataflash" else m.get_srcSystem())
        for field in m.get_fieldnames():
            value = getattr(m, field)
            if isinstance(value, (list, tuple)):
                for k, v in enumerate(value):
                    rows.setdefault((*key, f"{field}[{k}]"), []).append(v)
            else:
                rows.setdefault((*key, field), []).append(value)
    for key, values in rows.items():
        print(*key, *(repr(float(v)) for v in values))
