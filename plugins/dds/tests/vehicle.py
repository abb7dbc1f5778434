"""A vehicle of ROS 2 by Cyclone DDS: publishes the samples in a file of sentences as topics, and prints what it
receives of navfuse, an object of JSON in each line.

    vehicle.py DOMAIN SENTENCES SPEED TASK

The task is `commands` (a sensor off, a checkpoint), `manage` (a lifecycle manager, and an operator who sets the
pose) or `clock` (the time of a simulation, which begins anew).
"""

import json
import math
import random
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
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseWithCovarianceStamped_"):
    header: Header
    pose: PoseWithCovariance


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs::msg::dds_::Clock_"):
    clock: Time


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


domain, sentences, speed, task = int(sys.argv[1]), sys.argv[2], float(sys.argv[3]), sys.argv[4]
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
    "innovations": ("rt/innovations", DiagnosticArray),
    "pose": ("rt/pose", PoseStamped),
}
readers = {
    name: DataReader(participant, Topic(participant, topic, kind), qos=reliable)
    for name, (topic, kind) in received.items()
}
# nobody offers what a late subscriber missed: this one receives nothing
late = Qos(Policy.Reliability.Reliable(duration(seconds=1)), Policy.Durability.TransientLocal)
readers["mismatch"] = DataReader(participant, Topic(participant, "rt/odometry/global", Odometry), qos=late)
clock = DataWriter(participant, Topic(participant, "rt/clock", Clock), qos=best_effort)


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


@dataclass
class State(IdlStruct, typename="lifecycle_msgs::msg::dds_::State_"):
    id: uint8
    label: str


@dataclass
class Transition(IdlStruct, typename="lifecycle_msgs::msg::dds_::Transition_"):
    id: uint8
    label: str


@dataclass
class ChangeStateRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::ChangeState_Request_"):
    client: uint64
    number: int64
    transition: Transition


@dataclass
class ChangeStateResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::ChangeState_Response_"):
    client: uint64
    number: int64
    success: bool


@dataclass
class GetStateRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetState_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class GetStateResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetState_Response_"):
    client: uint64
    number: int64
    current_state: State


@dataclass
class StatesRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetAvailableStates_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class StatesResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetAvailableStates_Response_"):
    client: uint64
    number: int64
    available_states: sequence[State]


@dataclass
class TransitionDescription(IdlStruct, typename="lifecycle_msgs::msg::dds_::TransitionDescription_"):
    transition: Transition
    start_state: State
    goal_state: State


@dataclass
class TransitionsRequest(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetAvailableTransitions_Request_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


@dataclass
class TransitionsResponse(IdlStruct, typename="lifecycle_msgs::srv::dds_::GetAvailableTransitions_Response_"):
    client: uint64
    number: int64
    available_transitions: sequence[TransitionDescription]


@dataclass
class SetPoseRequest(IdlStruct, typename="robot_localization::srv::dds_::SetPose_Request_"):
    client: uint64
    number: int64
    pose: PoseStamped


@dataclass
class SetPoseResponse(IdlStruct, typename="robot_localization::srv::dds_::SetPose_Response_"):
    client: uint64
    number: int64
    structure_needs_at_least_one_member: uint8


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
    count = 0
    for name, reader in readers.items():
        for sample in reader.take(N=200):
            # a publisher that goes away is no message
            if isinstance(sample, IdlStruct):
                print(json.dumps({"topic": name} | plain(sample)))
                count += 1
    return count


def matched(writer):
    return len(writer.get_matched_subscriptions()) > 0


def manager():
    """The services of a lifecycle manager such as Nav2's, and of an operator."""
    kinds = {
        "change_state": (ChangeStateRequest, ChangeStateResponse),
        "get_state": (GetStateRequest, GetStateResponse),
        "get_available_states": (StatesRequest, StatesResponse),
        "get_transition_graph": (TransitionsRequest, TransitionsResponse),
        "enable_gnss": (SetBoolRequest, SetBoolResponse),
    }
    all = {name: Service(f"navfuse/{name}", *kind) for name, kind in kinds.items()}
    return all | {"set_pose": Service("set_pose", SetPoseRequest, SetPoseResponse)}


def set_pose(east, north, sigma):
    """An operator puts the vehicle at a place of `map`, with a stamp of zero as from the command line."""
    covariance = [0.0] * 36
    covariance[0] = covariance[7] = covariance[14] = sigma**2
    pose = Pose(Vector3(east, north, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))
    return PoseStamped(Header(Time(0, 0), "map"), PoseWithCovariance(pose, covariance))


# what happens at a time of the dive, s
plan = []
if task == "commands":
    depth = Service("navfuse/enable_depth", SetBoolRequest, SetBoolResponse)
    save = Service("navfuse/checkpoint", TriggerRequest, TriggerResponse)
if task == "manage":
    ask = manager()
    change = lambda number, label: lambda: ask["change_state"].call(Transition(number, label))  # noqa: E731
    plan = [
        (8.0, lambda: ask["get_state"].call(0)),
        # an unconfigured node cannot be activated
        (8.0, change(3, "")),
        (8.0, change(1, "")),
        (10.0, change(0, "activate")),
        (10.0, lambda: ask["get_state"].call(0)),
        (15.0, lambda: ask["enable_gnss"].call(False)),
        (16.0, lambda: ask["set_pose"].call(set_pose(500.0, -300.0, 3.0))),
        (30.0, change(4, "deactivate")),
        (30.0, lambda: ask["get_available_states"].call(0)),
        (30.0, lambda: ask["get_transition_graph"].call(0)),
    ]
begin = time.monotonic()
while not all(matched(writer) for writer in [*writers.values(), *([clock] if task == "clock" else [])]):
    if time.monotonic() - begin > 60:
        sys.exit("navfuse does not subscribe")
    time.sleep(0.05)


def deliveries():
    """The samples as a network delivers them: fixes 2 s late, other measurements up to 0.3 s late and in another order,
    and some of all not at all."""
    chance, all = random.Random(7), []
    with open(sentences, encoding="ascii") as file:
        for line in file:
            sensor, stamp, *values = line.split("*")[0].split(",")[1:]
            if sensor not in writers or chance.random() < (0.005 if sensor == "imu" else 0.02):
                continue
            late = {"imu": 0.0, "gnss": 2.0}.get(sensor, chance.uniform(0.0, 0.3))
            value = {name: float(number) for name, number in (v.split("=") for v in values)}
            all.append((float(stamp) + late, len(all), sensor, float(stamp), value))
    return sorted(all)


def dive(until):
    """Publishes the samples up to a time of the dive, s."""
    begin, first = time.monotonic(), None
    for due, _, sensor, stamp, value in deliveries():
        first = due if first is None else first
        if due > until:
            return
        while plan and plan[0][0] <= due:
            plan.pop(0)[1]()
            # the calls took time, which is no time of the dive
            begin = time.monotonic() - (due - first) / speed
        ahead = (due - first) / speed - (time.monotonic() - begin)
        if ahead > 0.001:
            drain()
            time.sleep(ahead)
        if sensor == "imu":
            clock.write(Clock(Time(int(stamp // 1), int(stamp % 1 * 1e9))))
        writers[sensor].write(of_sample(sensor, stamp, value))


dive(1e9)
if task == "commands":
    depth.call(False)
    save.call(0)
if task == "clock":
    dive(12.0)
# until nothing comes for a while: a busy computer is behind
quiet = time.monotonic()
while time.monotonic() - quiet < 2:
    if drain():
        quiet = time.monotonic()
    time.sleep(0.05)
