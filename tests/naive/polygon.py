"""Which cells lie in a polygon, by the definition of the winding number."""

import numpy as np


def winding_numbers(x, y, corners_x, corners_y):
    """How often the polygon goes around each point: the angle under which it is seen, summed up."""
    turned = np.zeros(np.shape(x))
    for k in range(len(corners_x)):
        n = (k + 1) % len(corners_x)
        ax, ay = corners_x[k] - x, corners_y[k] - y
        bx, by = corners_x[n] - x, corners_y[n] - y
        turned += np.arctan2(ax * by - ay * bx, ax * bx + ay * by)
    return np.rint(turned / (2.0 * np.pi)).astype(int)


def cells_inside(columns, rows):
    """Every (row, column) whose centre the polygon goes around."""
    row = np.arange(np.floor(rows.min()) - 1, np.ceil(rows.max()) + 2)
    column = np.arange(np.floor(columns.min()) - 1, np.ceil(columns.max()) + 2)
    y, x = np.meshgrid(row + 0.5, column + 0.5, indexing="ij")
    inside = winding_numbers(x, y, columns, rows) != 0
    return {(int(r), int(c)) for r, c in zip(y[inside] - 0.5, x[inside] - 0.5, strict=True)}
