"""The relations metric, one relation and one pose at a time."""

import math
import statistics


def nearest(stamped, time_ns):
    return min(
        range(len(stamped)), key=lambda index: (abs(stamped[index][0] - time_ns), stamped[index][0], index)
    )


def motion(first, second):
    """The second pose as seen from the first."""
    dx, dy = second[0] - first[0], second[1] - first[1]
    cos, sin = math.cos(first[2]), math.sin(first[2])
    return cos * dx + sin * dy, -sin * dx + cos * dy, math.remainder(second[2] - first[2], math.tau)


def moved(pose, step):
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return pose[0] + cos * step[0] - sin * step[1], pose[1] + sin * step[0] + cos * step[1], pose[2] + step[2]


def pose_at(time_ns, trajectory, odometry, max_dt_ns):
    stamp_ns, pose = trajectory[nearest(trajectory, time_ns)]
    if abs(stamp_ns - time_ns) <= max_dt_ns:
        return pose
    if odometry is None:
        return None
    then = odometry[nearest(odometry, stamp_ns)][1]
    now = odometry[nearest(odometry, time_ns)][1]
    return moved(pose, motion(then, now))


def errors(trajectory, relations, odometry, max_dt_ns):
    """(metres, degrees) of each relation that has both poses."""
    result = []
    for first_ns, second_ns, (x, y, theta) in relations:
        first = pose_at(first_ns, trajectory, odometry, max_dt_ns)
        second = pose_at(second_ns, trajectory, odometry, max_dt_ns)
        if first is not None and second is not None:
            dx, dy, dtheta = motion(first, second)
            angle = abs(math.remainder(dtheta - theta, math.tau))
            result.append((math.hypot(dx - x, dy - y), math.degrees(angle)))
    return result


def mean_and_deviation(values):
    return statistics.fmean(values), statistics.stdev(values)
