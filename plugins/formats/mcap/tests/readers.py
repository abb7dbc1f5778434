"""Reads a log with two independent readers of ROS 2 logs and compares every value with what the log should hold.

Usage: readers.py LOG EXPECTED.json

EXPECTED.json is a list of messages {topic, schema, log_time, fields}; in the fields a text is "s:TEXT" and a number with
a point is "f:" and its bits in hexadecimal, so that values are compared exactly.
"""

import collections
import dataclasses
import json
import pathlib
import struct
import sys

from mcap_ros2.reader import read_ros2_messages
from rosbags.highlevel import AnyReader


def same(found, expected):
    """Whether a decoded value is the expected one; in a message, whether it has just those fields."""
    if isinstance(expected, dict):
        if dataclasses.is_dataclass(found):
            # rosbags has the name of the type and the constants among the fields
            names = [f.name for f in dataclasses.fields(found) if f.name != "__msgtype__" and not f.name.isupper()]
        else:
            names = list(found.__slots__)
        return set(names) == set(expected) and all(same(getattr(found, k), v) for k, v in expected.items())
    if isinstance(expected, list):
        return len(found) == len(expected) and all(same(f, e) for f, e in zip(found, expected))
    if isinstance(expected, str) and expected.startswith("f:"):
        return struct.pack(">d", found).hex() == expected[2:]
    if isinstance(expected, str):
        return found == expected[2:]
    return int(found) == expected


def compare(reader, messages, expected):
    """Compares all messages of a reader, topic by topic; a message is (topic, schema, log time, value)."""
    found = collections.defaultdict(list)
    for topic, schema, log_time, value in messages:
        found[topic].append((schema, log_time, value))
    assert set(found) == set(expected), f"{reader}: topics {sorted(found)}"
    count = 0
    for topic, wanted in expected.items():
        assert len(found[topic]) == len(wanted), f"{reader}: {topic}: {len(found[topic])} of {len(wanted)} messages"
        for k, ((schema, log_time, value), want) in enumerate(zip(found[topic], wanted)):
            assert schema == want["schema"], f"{reader}: {topic}: {schema}"
            assert log_time == want["log_time"], f"{reader}: {topic} {k}: log time {log_time}"
            assert same(value, want["fields"]), f"{reader}: {topic} {k}: {value} is not {want['fields']}"
            count += 1
    print(f"{reader}: {count} messages on {len(found)} topics are equal")


def with_mcap_ros2(log):
    for m in read_ros2_messages(log):
        yield m.channel.topic, m.schema.name, m.log_time_ns, m.ros_msg


def with_rosbags(log):
    with AnyReader([pathlib.Path(log)]) as reader:
        for connection, log_time, data in reader.messages():
            yield connection.topic, connection.msgtype, log_time, reader.deserialize(data, connection.msgtype)


def main():
    log, expected_path = sys.argv[1:]
    expected = collections.defaultdict(list)
    with open(expected_path, encoding="utf-8") as file:
        # readers give messages in order of log time
        for message in sorted(json.load(file), key=lambda m: m["log_time"]):
            expected[message["topic"]].append(message)
    compare("mcap-ros2-support", with_mcap_ros2(log), expected)
    compare("rosbags", with_rosbags(log), expected)


if __name__ == "__main__":
    main()
