"""Poses between the lattice's: the field interpolated, the match refined below a cell and a step."""

import math

import numpy as np

from gridwright_server.jit import kernel

HALVINGS = 5
CLIMB_LIMIT = 3
"""Cells, and steps of the angle, that climbing may lead away from the lattice's best pose.

One would do for a smooth field; a patch is laid out no further than this.
"""


@kernel
def interpolated_sum(field, points, x_cells, y_cells, theta, resolution_m):
    """Sum over the end points of the field, bilinear between cell centres; a float64.

    The pose (x_cells, y_cells, theta) is in cells of the patch and rad, points in m.
    """
    c, s = math.cos(theta) / resolution_m, math.sin(theta) / resolution_m
    total = 0.0
    for k in range(len(points)):
        column = x_cells + c * points[k, 0] - s * points[k, 1] - 0.5
        row = y_cells + s * points[k, 0] + c * points[k, 1] - 0.5
        j, i = math.floor(column), math.floor(row)
        u, v = column - j, row - i
        lower = (1.0 - u) * field[i, j] + u * field[i, j + 1]
        upper = (1.0 - u) * field[i + 1, j] + u * field[i + 1, j + 1]
        total += (1.0 - v) * lower + v * upper
    return total


@kernel
def log_posterior(field, points, pose, predicted, resolution_m, objective):
    """Tempered log p(z | m, pose) + log p(pose | predicted), each up to a constant.

    Poses are (column, row, theta) in cells of the patch and rad.
    """
    dx, dy, turned = pose[0] - predicted[0], pose[1] - predicted[1], pose[2] - predicted[2]
    prior = objective.cell_precision * (dx * dx + dy * dy) + objective.angle_precision * turned * turned
    fit = interpolated_sum(field, points, pose[0], pose[1], pose[2], resolution_m)
    return objective.likelihood_scale * fit - 0.5 * prior


@kernel
def climb(field, points, start, predicted, resolution_m, window, objective):
    """Hill climbing from the best pose of the lattice: one axis at a time, halving the steps.

    Returns the pose (column, row, theta) reached.
    """
    pose = start.copy()
    best = log_posterior(field, points, pose, predicted, resolution_m, objective)
    steps = np.array((0.5, 0.5, 0.5 * window.angle_step_rad))
    limits = 2.0 * CLIMB_LIMIT * steps
    for _ in range(HALVINGS):
        improved = True
        while improved:
            improved = False
            for axis in range(3):
                for sign in (-1.0, 1.0):
                    trial = pose.copy()
                    trial[axis] += sign * steps[axis]
                    if abs(trial[axis] - start[axis]) > limits[axis]:
                        continue
                    score = log_posterior(field, points, trial, predicted, resolution_m, objective)
                    if score > best:
                        best, pose, improved = score, trial, True
        steps *= 0.5
    return pose
