"""Poses in the plane as homogeneous 3 x 3 matrices."""

import numpy as np


def matrix(pose):
    x, y, theta = pose
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, -s, x], [s, c, y], [0.0, 0.0, 1.0]])


def pose(matrix):
    return np.array([matrix[0, 2], matrix[1, 2], np.arctan2(matrix[1, 0], matrix[0, 0])])


def driven(twist, seconds, steps=4096):
    """Where a robot is that drives at a constant twist (vx, vy, omega): many small straight moves."""
    result, power = np.eye(3), matrix(np.asarray(twist) * (seconds / steps))
    for bit in range(steps.bit_length()):
        if steps >> bit & 1:
            result = result @ power
        power = power @ power
    return pose(result)
