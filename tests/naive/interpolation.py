"""The field between the centres of its cells."""

import math

from naive.homogeneous import matrix


def at(field, x, y):
    """Bilinear: each of all cells counts by how much of a unit square around (x, y) it holds."""
    value = 0.0
    for row in range(math.floor(y) - 1, math.floor(y) + 2):
        for column in range(math.floor(x) - 1, math.floor(x) + 2):
            width = max(0.0, 1.0 - abs(x - (column + 0.5)))
            height = max(0.0, 1.0 - abs(y - (row + 0.5)))
            value += width * height * float(field[row, column])
    return value


def total(field, points, pose_cells, resolution_m):
    cells_from_base = matrix(pose_cells)
    result = 0.0
    for x, y in points:
        column, row, _ = cells_from_base @ (x / resolution_m, y / resolution_m, 1.0)
        result += at(field, column, row)
    return result


def log_posterior(field, points, pose, predicted, resolution_m, objective):
    squared = objective.cell_precision * ((pose[0] - predicted[0]) ** 2 + (pose[1] - predicted[1]) ** 2)
    squared += objective.angle_precision * (pose[2] - predicted[2]) ** 2
    return objective.likelihood_scale * total(field, points, pose, resolution_m) - 0.5 * squared
