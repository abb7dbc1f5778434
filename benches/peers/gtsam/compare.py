"""Smooths road.toml with navfuse, solves the same problem with GTSAM, and compares both.

Usage: compare.py NAVFUSE

NAVFUSE is the command, built with --release. The script needs gtsam 4.3, mcap-ros2-support
and numpy from PyPI; where one is missing, it prints that and ends without an error.

GTSAM gets the samples from navfuse's log. Its batch optimisation (Levenberg-Marquardt) has a pose
and a velocity for each odometer sample, one bias of the IMU, preintegrated IMU factors with the
rotation of the Earth, GPS factors, and the velocity along the body as a custom factor with its
Jacobian. It begins at the filter's estimates.
"""

import math
import pathlib
import resource
import subprocess
import sys
import tempfile
import time

try:
    import gtsam
    import numpy as np
    from mcap_ros2.reader import read_ros2_messages
except ImportError as error:
    print(f"skipped: {error}; install it with: pip install 'gtsam>=4.3' mcap-ros2-support numpy")
    sys.exit(0)

START = 1.0  # s, as estimator.start
DEG = math.pi / 180.0
A, E2, EARTH = 6378137.0, 6.69437999014e-3, 7.292115e-5  # WGS-84


def ecef(lat, lon, height):
    n = A / math.sqrt(1.0 - E2 * math.sin(lat) ** 2)
    flat = (n + height) * math.cos(lat)
    up = (n * (1.0 - E2) + height) * math.sin(lat)
    return np.array([flat * math.cos(lon), flat * math.sin(lon), up])


def north_east_down(lat, lon):
    """Rows: north, east, down in the axes of the Earth."""
    s, c, sl, cl = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return np.array([[-s * cl, -s * sl, c], [-sl, cl, 0.0], [-c * cl, -c * sl, -s]])


def gravity(lat, height):
    """Normal gravity of WGS-84, m/s2."""
    s2 = math.sin(lat) ** 2
    surface = 9.7803253359 * (1.0 + 1.931852652e-3 * s2) / math.sqrt(1.0 - E2 * s2)
    return surface - 3.0877e-6 * height


def read(log):
    """Samples and estimates of a log, each a row with its time first."""
    rows = {"imu": [], "gnss": [], "odometer": [], "reference": [], "fix": [], "odometry": []}
    for m in read_ros2_messages(log):
        topic, message = m.channel.topic, m.ros_msg
        name = topic.rsplit("/", 1)[1]
        if name not in rows or not topic.startswith(("/sensor/", "/estimate/")):
            continue
        stamp = message.header.stamp
        t = stamp.sec + 1e-9 * stamp.nanosec
        if name == "imu":
            w, f = message.angular_velocity, message.linear_acceleration
            rows[name].append([t, w.x, w.y, w.z, f.x, f.y, f.z])
        elif name == "fix":
            lat, lon = message.latitude * DEG, message.longitude * DEG
            rows[name].append([t, lat, lon, message.altitude])
        elif name == "odometry":
            q, v = message.pose.pose.orientation, message.twist.twist.linear
            rows[name].append([t, q.w, q.x, q.y, q.z, v.x, v.y, v.z])
        else:
            rows[name].append([t, *message.values])
    return {name: np.array(values) for name, values in rows.items()}


def optimise(rows, place, start):
    """The batch solution of GTSAM: times and positions. `start` has the estimates of the filter."""
    _, lat, _, height = start["fix"][0]
    params = gtsam.PreintegrationParams.MakeSharedD(gravity(lat, height))
    params.setGyroscopeCovariance(np.eye(3) * (20.0 * DEG / 3600.0) ** 2)
    params.setAccelerometerCovariance(np.eye(3) * (100e-6 * 9.80665) ** 2)
    params.setIntegrationCovariance(np.eye(3) * 1e-8)
    params.setOmegaCoriolis(EARTH * np.array([math.cos(lat), 0.0, -math.sin(lat)]))
    pose, velocity = gtsam.symbol_shorthand.X, gtsam.symbol_shorthand.V
    bias = gtsam.symbol_shorthand.B(0)
    sigmas = gtsam.noiseModel.Diagonal.Sigmas
    graph, guess = gtsam.NonlinearFactorGraph(), gtsam.Values()

    # the estimates of the filter: the first one is the prior mean, the others are the first guess,
    # from which few iterations are left
    filtered = {}
    for q, fix in zip(start["odometry"], start["fix"]):
        turned = gtsam.Rot3.Quaternion(*q[1:5])
        filtered[round(q[0], 3)] = (turned, place(fix[1:4]), turned.matrix() @ q[5:8])
    rotation, position, speed = filtered[round(START, 3)]
    zero = gtsam.imuBias.ConstantBias()
    first = gtsam.Pose3(rotation, position)
    pose_sigmas = np.array([0.5 * DEG, 0.5 * DEG, 2.0 * DEG, 1.0, 1.0, 1.0])
    bias_sigmas = np.array([2e-3 * 9.80665] * 3 + [30.0 * DEG / 3600.0] * 3)
    graph.add(gtsam.PriorFactorPose3(pose(0), first, sigmas(pose_sigmas)))
    graph.add(gtsam.PriorFactorVector(velocity(0), speed, sigmas(np.full(3, 0.1))))
    graph.add(gtsam.PriorFactorConstantBias(bias, zero, sigmas(bias_sigmas)))
    guess.insert(bias, zero)
    guess.insert(pose(0), first)
    guess.insert(velocity(0), speed)

    def along_body(measured, this, values, jacobians):
        turn = values.atPose3(this.keys()[0]).rotation().matrix().T
        moved = turn @ values.atVector(this.keys()[1])
        if jacobians is not None:
            x, y, z = moved
            cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
            jacobians[0] = np.asfortranarray(np.hstack([cross, np.zeros((3, 3))]))
            jacobians[1] = np.asfortranarray(turn)
        return moved - measured

    odometer_noise, gnss_noise = sigmas(np.full(3, 0.1)), sigmas(np.array([1.0, 1.0, 2.0]))
    fixes = {round(row[0], 3): place(row[1:4]) for row in rows["gnss"]}
    imu = rows["imu"][rows["imu"][:, 0] > START + 1e-6]
    used, before, times = 0, START, [START]
    for k, row in enumerate(rows["odometer"][rows["odometer"][:, 0] > START + 1e-6], 1):
        part = gtsam.PreintegratedImuMeasurements(params, zero)
        while used < len(imu) and imu[used, 0] < row[0] + 1e-6:
            part.integrateMeasurement(imu[used, 4:7], imu[used, 1:4], imu[used, 0] - before)
            before, used = imu[used, 0], used + 1
        graph.add(gtsam.ImuFactor(pose(k - 1), velocity(k - 1), pose(k), velocity(k), bias, part))
        def error(this, values, jacobians, measured=row[1:4]):
            return along_body(measured, this, values, jacobians)

        graph.add(gtsam.CustomFactor(odometer_noise, [pose(k), velocity(k)], error))
        at = round(row[0], 3)
        if at in fixes:
            graph.add(gtsam.GPSFactor(pose(k), fixes[at], gnss_noise))
        turned, position, moved = filtered[at]
        guess.insert(pose(k), gtsam.Pose3(turned, position))
        guess.insert(velocity(k), moved)
        times.append(row[0])
    optimiser = gtsam.LevenbergMarquardtOptimizer(graph, guess)
    built = time.process_time()
    result = optimiser.optimize()
    print(f"gtsam: {optimiser.iterations()} iterations in {time.process_time() - built:.2f} s")
    return np.array([[t, *result.atPose3(pose(k)).translation()] for k, t in enumerate(times)])


def rmse(track, truth):
    """Horizontal root mean square error at the times that both have, m."""
    at = {round(row[0], 3): row[1:4] for row in truth}
    pairs = [(row[1:3], at[round(row[0], 3)][:2]) for row in track if round(row[0], 3) in at]
    squares = [((estimate - true) ** 2).sum() for estimate, true in pairs]
    return math.sqrt(sum(squares) / len(squares)), len(squares)


def main():
    navfuse, scenario = sys.argv[1], pathlib.Path(__file__).with_name("road.toml")
    with tempfile.TemporaryDirectory() as folder:
        command = [navfuse, "smooth", str(scenario)]
        settings = ["--quiet", "--set", "estimator.output_rate=\"5 Hz\""]
        subprocess.run([*command, "--out", f"{folder}/run", *settings], check=True)
        rows = read(f"{folder}/run/run.mcap")
        filtered = [navfuse, "run", str(scenario), "--out", f"{folder}/start", *settings]
        subprocess.run(filtered, check=True)
        start = read(f"{folder}/start/run.mcap")
        spent = []
        for _ in range(3):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([*command, "--no-output", "--quiet"], check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime - before.ru_utime)
    _, lat, lon, height = start["fix"][0]
    axes, origin = north_east_down(lat, lon), ecef(lat, lon, height)

    def place(row):
        return axes @ (ecef(*row) - origin)

    def track_of(name):
        return np.array([[r[0], *place(r[1:4])] for r in rows[name] if r[0] > START - 1e-6])

    fix, truth = track_of("fix"), track_of("reference")
    begin = time.process_time()
    track = optimise(rows, place, start)
    theirs = time.process_time() - begin
    (our_error, count), (their_error, _) = rmse(fix, truth), rmse(track, truth)
    ours, ratio = min(spent), our_error / their_error
    print(f"{len(track)} poses, {len(rows['imu'])} IMU samples")
    print(f"horizontal rmse of {count} epochs, m: navfuse {our_error:.4f}, gtsam {their_error:.4f}")
    print(f"processor time, s: navfuse {ours:.2f} with the simulation, gtsam {theirs:.2f}")
    print(f"ratio of the errors {ratio:.3f}, of the times {ours / theirs:.3f}")
    good = abs(ratio - 1.0) <= 0.05 and ours <= 0.1 * theirs
    sys.exit(0 if good else 1)


if __name__ == "__main__":
    main()
