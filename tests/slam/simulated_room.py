"""A room of straight walls, a laser that measures it ray by ray, and odometry that drifts."""

import itertools

import numpy as np
from gridwright_server.slam import se2
from gridwright_server.slam.types import Scan

SECOND_NS = 1_000_000_000
FRONT = np.array((0.1, 0.0, 0.0))
BACKWARDS = np.array((-0.2, 0.05, np.pi))
FULL_CIRCLE = np.radians(np.arange(-180.0, 180.5, 1.0))
HALF_CIRCLE = np.radians(np.arange(-90.0, 90.5, 1.0))


def box(left, bottom, right, top):
    corners = [(left, bottom), (right, bottom), (right, top), (left, top)]
    return [(corners[k], corners[(k + 1) % 4]) for k in range(4)]


ROOM = box(-3.0, -2.5, 4.0, 2.5) + box(1.7, -2.0, 2.3, -1.2) + box(-2.2, 1.1, -1.4, 2.5)


def cast(walls, origin, angles_rad):
    """Range along each ray to the first wall; infinite where there is none."""
    ranges = np.full(len(angles_rad), np.inf)
    dx, dy = np.cos(angles_rad), np.sin(angles_rad)
    for (ax, ay), (bx, by) in walls:
        ex, ey = bx - ax, by - ay
        with np.errstate(divide="ignore", invalid="ignore"):
            along_ray = ((ax - origin[0]) * ey - (ay - origin[1]) * ex) / (dx * ey - dy * ex)
            along_wall = ((ax - origin[0]) * dy - (ay - origin[1]) * dx) / (dx * ey - dy * ex)
        hit = (along_ray > 0.0) & (along_wall >= 0.0) & (along_wall <= 1.0)
        ranges = np.where(hit & (along_ray < ranges), along_ray, ranges)
    return ranges


def scan_at(
    stamp_ns, map_from_base, rng, walls=ROOM, bearings_rad=HALF_CIRCLE, base_from_laser=FRONT, noise_m=0.01
):
    x, y, theta = se2.compose(map_from_base, base_from_laser)
    ranges = cast(walls, (x, y), theta + bearings_rad)
    return Scan(
        stamp_ns,
        bearings_rad,
        ranges + rng.normal(scale=noise_m, size=len(ranges)),
        0.05,
        20.0,
        base_from_laser,
    )


def drive(steps, step=(0.21, 0.0, 0.21), start=(0.3, -1.0, 0.0)):
    """True poses, by default on a circle of 1 m within the room."""
    poses = [np.array(start, np.float64)]
    for _ in range(steps):
        poses.append(se2.compose(poses[-1], np.array(step)))
    return poses


def drifting(poses, factor=1.06, turn_rad=0.012):
    """What wheels report that count too far and pull to one side."""
    odometry = [poses[0]]
    for before, after in itertools.pairwise(poses):
        moved = se2.between(before, after) * (factor, 1.0, 1.0) + (0.0, 0.0, turn_rad)
        odometry.append(se2.compose(odometry[-1], moved))
    return odometry
