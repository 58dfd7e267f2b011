"""One robot's map, cell by cell in a dict, and what is derived from it, recomputed from nothing."""

import math

import numpy as np
from naive.polygon import cells_inside


def cells_of_scan(outline, points, pose, resolution_m):
    """Free cells (a set) and hit cells (a list; successive equal ones once) of a scan taken at pose."""
    c, s = np.cos(pose[2]), np.sin(pose[2])

    def to_cells(xy):
        x = pose[0] + c * xy[:, 0] - s * xy[:, 1]
        y = pose[1] + s * xy[:, 0] + c * xy[:, 1]
        return x / resolution_m, y / resolution_m

    free = cells_inside(*to_cells(outline))
    hits = []
    for x, y in zip(*to_cells(points), strict=True):
        cell = (math.floor(y), math.floor(x))
        if not hits or hits[-1] != cell:
            hits.append(cell)
    return free, hits


class OneMap:
    """Log-odds by (row, column); cells that are not there are unknown."""

    def __init__(self, free, hit, limit):
        self.log_odds = {}
        self._free, self._hit, self._limit = free, hit, limit

    def integrate(self, free_cells, hit_cells):
        for cell in free_cells:
            self.log_odds[cell] = max(self.log_odds.get(cell, 0) - self._free, -self._limit)
        for cell in hit_cells:
            self.log_odds[cell] = min(self.log_odds.get(cell, 0) + self._hit, self._limit)

    def surfaces(self):
        return [cell for cell, log_odds in self.log_odds.items() if log_odds > 0]


def field_of(surfaces, rows, columns, resolution_m, sigma_m, outlier):
    """The field of all cells rows x columns: each cell's own distance to its nearest surface."""
    r, c = np.meshgrid(rows, columns, indexing="ij")
    nearest = np.full(r.shape, np.inf)
    for row, column in surfaces:
        nearest = np.minimum(nearest, np.hypot(r - row, c - column))
    p = (1.0 - outlier) * np.exp(-((nearest * resolution_m) ** 2) / (2.0 * sigma_m**2)) + outlier
    share = np.log(p / outlier) / np.log(1.0 / outlier)  # 1 on a surface, 0 far from any
    return np.rint(255 * np.where(share < 0.01, 0.0, share)).astype(int)


def block_maxima(field, block_cells):
    rows, columns = field.shape[0] // block_cells, field.shape[1] // block_cells
    return field.reshape(rows, block_cells, columns, block_cells).max(axis=(1, 3))
