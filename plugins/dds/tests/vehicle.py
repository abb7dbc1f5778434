"""A vehicle of ROS 2 by Cyclone DDS: publishes the samples in a file of sentences as topics, and prints what it
receives of navfuse, an object of JSON in each line.

    ros2.py DOMAIN SENTENCES SPEED
"""

import json
import math
import sys
import time
from dataclasses import dataclass

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import array, float64, int8, int32, int64, sequence, uint8, uint16, uint32, uint64
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs::msg::dds_::Vector3_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Imu(IdlStruct, typename="sensor_msgs::msg::dds_::Imu_"):
    header: Header
    orientation: Quaternion
    orientation_covariance: array[float64, 9]
    angular_velocity: Vector3
    angular_velocity_covariance: array[float64, 9]
    linear_acceleration: Vector3
    linear_acceleration_covariance: array[float64, 9]


@dataclass
class FluidPressure(IdlStruct, typename="sensor_msgs::msg::dds_::FluidPressure_"):
    header: Header
    fluid_pressure: float64
    variance: float64


@dataclass
class NavSatStatus(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatStatus_"):
    status: int8
    service: uint16


@dataclass
class NavSatFix(IdlStruct, typename="sensor_msgs::msg::dds_::NavSatFix_"):
    header: Header
    status: NavSatStatus
    latitude: float64
    longitude: float64
    altitude: float64
    position_covariance: array[float64, 9]
    position_covariance_type: uint8


@dataclass
class Twist(IdlStruct, typename="geometry_msgs::msg::dds_::Twist_"):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovariance_"):
    twist: Twist
    covariance: array[float64, 36]


@dataclass
class TwistStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TwistWithCovarianceStamped_"):
    header: Header
    twist: TwistWithCovariance


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Vector3
    orientation: Quaternion


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovariance_"):
    pose: Pose
    covariance: array[float64, 36]


@dataclass
class Odometry(IdlStruct, typename="nav_msgs::msg::dds_::Odometry_"):
    header: Header
    child_frame_id: str
    pose: PoseWithCovariance
    twist: TwistWithCovariance


@dataclass
class Transform(IdlStruct, typename="geometry_msgs::msg::dds_::Transform_"):
    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs::msg::dds_::TransformStamped_"):
    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs::msg::dds_::TFMessage_"):
    transforms: sequence[TransformStamped]


@dataclass
class KeyValue(IdlStruct, typename="diagnostic_msgs::msg::dds_::KeyValue_"):
    key: str
    value: str


@dataclass
class DiagnosticStatus(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticStatus_"):
    level: uint8
    name: str
    message: str
    hardware_id: str
    values: sequence[KeyValue]


@dataclass
class DiagnosticArray(IdlStruct, typename="diagnostic_msgs::msg::dds_::DiagnosticArray_"):
    header: Header
    status: sequence[DiagnosticStatus]


def flu(x, y, z):
    """A vector along forward, right, down, along forward, left, up (REP 103)."""
    return Vector3(x, -y, -z)


def of_sample(sensor, stamp, value):
    header = Header(Time(int(stamp // 1), int(stamp % 1 * 1e9)), "base_link")
    zero = Vector3(0.0, 0.0, 0.0)
    if sensor == "imu":
        rate = flu(*(value[f"gyro_{axis}"] for axis in "xyz"))
        force = flu(*(value[f"accel_{axis}"] for axis in "xyz"))
        unknown = [-1.0] + 8 * [0.0]
        return Imu(header, Quaternion(0.0, 0.0, 0.0, 1.0), unknown, rate, 9 * [0.0], force, 9 * [0.0])
    if sensor == "depth":
        return FluidPressure(header, 101325.0 + 1025.0 * 9.80665 * value["depth"], 0.0)
    if sensor == "gnss":
        place = (math.degrees(value["lat"]), math.degrees(value["lon"]), value["height"])
        return NavSatFix(header, NavSatStatus(0, 1), *place, [1.0, 0, 0, 0, 1.0, 0, 0, 0, 4.0], 2)
    speed = flu(*(value[f"vel_{axis}"] for axis in "xyz"))
    covariance = [1e-4 if k % 7 == 0 else 0.0 for k in range(36)]
    return TwistStamped(header, TwistWithCovariance(Twist(speed, zero), covariance))


domain, sentences, speed = int(sys.argv[1]), sys.argv[2], float(sys.argv[3])
participant = DomainParticipant(domain)
best_effort = Qos(Policy.Reliability.BestEffort, Policy.History.KeepLast(1000))
reliable = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.History.KeepLast(1000))
topics = {
    "imu": ("rt/imu/data", Imu),
    "gnss": ("rt/fix", NavSatFix),
    "dvl": ("rt/dvl/twist", TwistStamped),
    "depth": ("rt/pressure", FluidPressure),
}
writers = {
    sensor: DataWriter(participant, Topic(participant, name, kind), qos=best_effort)
    for sensor, (name, kind) in topics.items()
}
received = {
    "global": ("rt/odometry/global", Odometry),
    "local": ("rt/odometry/local", Odometry),
    "tf": ("rt/tf", TFMessage),
    "diagnostics": ("rt/diagnostics", DiagnosticArray),
}
readers = {
    name: DataReader(participant, Topic(participant, topic, kind), qos=reliable)
    for name, (topic, kind) in received.items()
}


@dataclass
class TriggerRequest(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class TriggerResponse(IdlStruct, typename="std_srvs::srv::dds_::Trigger_Response_"):
    client: uint64
    number: int64
    success: bool
    message: str


@dataclass
class SetBoolRequest(IdlStruct, typename="std_srvs::srv::dds_::SetBool_Request_"):
    client: uint64
    number: int64
    data: bool


@dataclass
class SetBoolResponse(IdlStruct, typename="std_srvs::srv::dds_::SetBool_Response_"):
    client: uint64
    number: int64
    success: bool
    message: str


class Service:
    """A client as rmw_cyclonedds writes one: its identity stands before the content."""

    def __init__(self, name, request, response):
        self.name, self.request, self.number = name, request, 0
        self.writer = DataWriter(participant, Topic(participant, f"rq/{name}Request", request), qos=reliable)
        self.reader = DataReader(participant, Topic(participant, f"rr/{name}Reply", response), qos=reliable)

    def call(self, value):
        self.number += 1
        until = time.monotonic() + 20
        while not (matched(self.writer) and len(self.reader.get_matched_publications()) > 0):
            if time.monotonic() > until:
                sys.exit(f"nobody offers {self.name}")
            time.sleep(0.05)
        self.writer.write(self.request(4711, self.number, value))
        while time.monotonic() < until:
            for answer in self.reader.take(N=10):
                if (answer.client, answer.number) == (4711, self.number):
                    print(json.dumps({"topic": "answer", "service": self.name} | plain(answer)))
                    return
            time.sleep(0.02)
        sys.exit(f"no answer of {self.name}")


def plain(value):
    if hasattr(value, "__dataclass_fields__"):
        return {name: plain(getattr(value, name)) for name in value.__dataclass_fields__}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    return value


def drain():
    for name, reader in readers.items():
        for sample in reader.take(N=200):
            print(json.dumps({"topic": name} | plain(sample)))


def matched(writer):
    return len(writer.get_matched_subscriptions()) > 0


depth = Service("navfuse/enable_depth", SetBoolRequest, SetBoolResponse)
save = Service("navfuse/checkpoint", TriggerRequest, TriggerResponse)
begin = time.monotonic()
while not all(matched(writer) for writer in writers.values()):
    if time.monotonic() - begin > 60:
        sys.exit("navfuse does not subscribe")
    time.sleep(0.05)

begin, first = time.monotonic(), None
with open(sentences, encoding="ascii") as file:
    for line in file:
        sensor, stamp, *values = line.split("*")[0].split(",")[1:]
        if sensor not in writers:
            continue
        stamp = float(stamp)
        first = stamp if first is None else first
        ahead = (stamp - first) / speed - (time.monotonic() - begin)
        if ahead > 0.001:
            drain()
            time.sleep(ahead)
        value = {name: float(number) for name, number in (v.split("=") for v in values)}
        writers[sensor].write(of_sample(sensor, stamp, value))
depth.call(False)
save.call(0)
until = time.monotonic() + 2
while time.monotonic() < until:
    drain()
    time.sleep(0.05)
