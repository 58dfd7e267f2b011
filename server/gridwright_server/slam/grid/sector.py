"""Which cells a scan saw free: the union of its beams' sectors, as runs of cells.

A beam stands for the sector between it and half-way to its neighbours (thesis figure 5). The sectors
of a scan together make a star-shaped polygon around the laser; a scan line fill of that polygon meets
every cell of every sector exactly once, which walking the beams one by one does not.
"""

import math

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel

SAME_SURFACE_M = 0.3
"""Neighbouring returns closer than this in range are taken to lie on one surface."""


@kernel
def sector_outline(
    bearings_rad: NDArray[np.float64],
    ranges_m: NDArray[np.float64],
    margin_m: float,
    laser: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Corners of the free polygon in base_link, shape (2 beams + 1, 2); the first is the laser.

    Each beam gives two corners, on its borders with its neighbours; a beam without return gives the
    laser's place twice, so its sector is empty. The sectors end margin_m before what was hit, and
    two neighbours on one surface meet in the middle: else the nearer one's wall would be cut.
    """
    beams = len(bearings_rad)
    corners = np.empty((2 * beams + 1, 2))
    corners[0] = laser
    for j in range(beams):
        own = max(ranges_m[j] - margin_m, 0.0)
        for side in range(2):
            k = min(max(j + 2 * side - 1, 0), beams - 1)
            if k == j:  # the scan's first or last border: as far out as the one on the other side
                k = min(max(j + 1 - 2 * side, 0), beams - 1)
                bearing = 1.5 * bearings_rad[j] - 0.5 * bearings_rad[k]
                k = j
            else:
                bearing = 0.5 * (bearings_rad[j] + bearings_rad[k])
            reach = own
            if own > 0.0 and ranges_m[k] > 0.0 and abs(ranges_m[k] - ranges_m[j]) < SAME_SURFACE_M:
                reach = max(0.5 * (ranges_m[j] + ranges_m[k]) - margin_m, 0.0)
            corners[2 * j + 1 + side, 0] = laser[0] + reach * math.cos(bearing)
            corners[2 * j + 1 + side, 1] = laser[1] + reach * math.sin(bearing)
    return corners


@kernel
def fill_runs(columns, rows):
    """Runs of cells whose centres lie in a polygon (non-zero winding), shape (runs, 3).

    `columns` and `rows` are the polygon's corners in cells (float64); a run is (row, first column,
    one beyond the last column), sorted by row, then column.
    """
    corners = len(columns)
    bottom, top = math.ceil(rows.min() - 0.5), math.ceil(rows.max() - 0.5)
    height = max(top - bottom, 0)
    # First count, then place, each row's crossings: a bucket per row.
    starts = np.zeros(height + 1, np.int64)
    for k in range(corners):
        first, beyond = _rows_crossed(rows[k], rows[(k + 1) % corners])
        for row in range(first, beyond):
            starts[row - bottom + 1] += 1
    for row in range(height):
        starts[row + 1] += starts[row]
    where = np.empty(starts[height])
    turns = np.empty(starts[height], np.int8)
    filled = starts.copy()
    for k in range(corners):
        r0, r1 = rows[k], rows[(k + 1) % corners]
        c0, c1 = columns[k], columns[(k + 1) % corners]
        first, beyond = _rows_crossed(r0, r1)
        for row in range(first, beyond):
            slot = filled[row - bottom]
            where[slot] = c0 + (row + 0.5 - r0) * (c1 - c0) / (r1 - r0)
            turns[slot] = 1 if r1 > r0 else -1
            filled[row - bottom] += 1
    runs = np.empty((len(where), 3), np.int64)
    count = 0
    for row in range(height):
        _sort_crossings(where, turns, starts[row], starts[row + 1])
        winding = 0
        begin = 0
        for slot in range(starts[row], starts[row + 1]):
            column = math.ceil(where[slot] - 0.5)
            if winding == 0:
                begin = column
            winding += turns[slot]
            if winding == 0 and column > begin:
                runs[count, 0], runs[count, 1], runs[count, 2] = bottom + row, begin, column
                count += 1
    return runs[:count]


@kernel
def _rows_crossed(r0, r1):
    """Rows whose centre line an edge crosses: the lower end counts, the upper does not."""
    return math.ceil(min(r0, r1) - 0.5), math.ceil(max(r0, r1) - 0.5)


@kernel
def _sort_crossings(where, turns, begin, end):
    """Insertion sort: a row has few crossings, most already in order."""
    for i in range(begin + 1, end):
        w, t = where[i], turns[i]
        j = i - 1
        while j >= begin and where[j] > w:
            where[j + 1], turns[j + 1] = where[j], turns[j]
            j -= 1
        where[j + 1], turns[j + 1] = w, t
