"""Integrating a scan into a particle's map (4.17, 4.18): log-odds, then the field derived from them."""

import math

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.likelihood import add_surface, remove_surface
from gridwright_server.slam.grid.sector import fill_runs
from gridwright_server.slam.grid.tiles import UNKNOWN

LOG_ODDS_UNIT = 0.001


def log_odds_units(log_odds: float) -> int:
    """Log-odds as tiles store them: integers, so that sums are exact."""
    return round(log_odds / LOG_ODDS_UNIT)


def occupancy_percent(log_odds: NDArray[np.int16]) -> NDArray[np.int8]:
    """-1 where unknown, else the probability in percent, 0..100 (4.17); same shape."""
    probability = 1.0 - 1.0 / (1.0 + np.exp(log_odds.astype(np.float64) * LOG_ODDS_UNIT))
    return np.where(log_odds == UNKNOWN, -1, np.rint(100.0 * probability)).astype(np.int8)


@kernel
def cells_seen(outline, points, pose, resolution_m):
    """What a scan taken at `pose` (map_from_base) says about which cells.

    Returns runs of free cells, shape (runs, 3) as fill_runs, and hit cells (row, column), shape
    (hits, 2), a cell that successive beams hit listed once. Indices count on the lattice.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    columns = (pose[0] + c * outline[:, 0] - s * outline[:, 1]) / resolution_m
    rows = (pose[1] + s * outline[:, 0] + c * outline[:, 1]) / resolution_m
    runs = fill_runs(columns, rows)
    hits = np.empty((len(points), 2), np.int64)
    count = 0
    for k in range(len(points)):
        column = math.floor((pose[0] + c * points[k, 0] - s * points[k, 1]) / resolution_m)
        row = math.floor((pose[1] + s * points[k, 0] + c * points[k, 1]) / resolution_m)
        if count == 0 or row != hits[count - 1, 0] or column != hits[count - 1, 1]:
            hits[count, 0], hits[count, 1] = row, column
            count += 1
    return runs, hits[:count]


@kernel
def tiles_wanted(runs, hits, radius, tile_cells, first_cell, wanted):
    """Marks the tiles that integrating may write: cells seen, and `radius` cells around them.

    first_cell: lattice row and column of the first cell of `wanted`'s first tile.
    """
    row0, column0 = first_cell
    for k in range(len(runs)):
        row, first, last = runs[k, 0] - row0, runs[k, 1] - column0, runs[k, 2] - 1 - column0
        _mark(row, first, last, radius, tile_cells, wanted)
    for k in range(len(hits)):
        column = hits[k, 1] - column0
        _mark(hits[k, 0] - row0, column, column, radius, tile_cells, wanted)


@kernel
def _mark(row, first, last, radius, tile_cells, wanted):
    for tile_row in range((row - radius) // tile_cells, (row + radius) // tile_cells + 1):
        for tile_column in range((first - radius) // tile_cells, (last + radius) // tile_cells + 1):
            wanted[tile_row, tile_column] = True


@kernel
def integrate(arrays, table, first_cell, runs, hits, grid):
    """Updates log-odds (4.18), field and blocks of a particle's own tiles.

    table: the page table whose first tile starts at first_cell, lattice row and column; runs and hits
    as of cells_seen; grid: a particles.Grid. A cell that was both crossed and hit gets both.
    """
    removed = _lower(arrays.log_odds, table, first_cell, runs, grid)
    added = _raise(arrays.log_odds, table, first_cell, hits, grid)
    n = grid.tile_cells
    changed = np.zeros(table.shape, np.bool_)
    radius = grid.stamp.shape[0] // 2
    for row, column in removed:
        tile = table[row // n, column // n]
        if arrays.log_odds[tile, row % n, column % n] <= 0:
            remove_surface(arrays.log_odds, arrays.field, table, n, row, column, grid.stamp)
            _mark(row, column, column, radius, n, changed)
    for row, column in added:
        add_surface(arrays.field, table, n, row, column, grid.stamp)
        _mark(row, column, column, radius, n, changed)
    for tile_row in range(table.shape[0]):
        for tile_column in range(table.shape[1]):
            if changed[tile_row, tile_column]:
                _update_blocks(arrays.field, arrays.blocks, table[tile_row, tile_column])


@kernel
def _lower(log_odds, table, first_cell, runs, grid):
    """Takes `free` from the cells of all runs; returns those that were surfaces before, shape (k, 2)."""
    row0, column0 = first_cell
    tile_cells = grid.tile_cells
    removed = np.empty((16, 2), np.int64)
    removals = 0
    for k in range(len(runs)):
        row, column, end = runs[k, 0] - row0, runs[k, 1] - column0, runs[k, 2] - column0
        tile_row, r = row // tile_cells, row % tile_cells
        while column < end:
            tile = table[tile_row, column // tile_cells]
            begin = column % tile_cells
            beyond = min(begin + end - column, tile_cells)
            line = log_odds[tile, r, begin:beyond]
            if _lower_line(line, grid.free, grid.limit):
                removed, removals = _note_removals(removed, removals, line, grid.free, row, column)
            column += beyond - begin
    return removed[:removals]


@kernel
def _raise(log_odds, table, first_cell, hits, grid):
    """Adds `hit` to the cells hit; returns those that were no surfaces before, shape (k, 2)."""
    n = grid.tile_cells
    added = np.empty((len(hits), 2), np.int64)
    additions = 0
    for k in range(len(hits)):
        row, column = hits[k, 0] - first_cell[0], hits[k, 1] - first_cell[1]
        tile, r, c = table[row // n, column // n], row % n, column % n
        old = log_odds[tile, r, c]
        log_odds[tile, r, c] = min((0 if old == UNKNOWN else old) + grid.hit, grid.limit)
        if old <= 0:
            added[additions, 0], added[additions, 1] = row, column
            if log_odds[tile, r, c] > 0:
                additions += 1
    return added[:additions]


@kernel
def _lower_line(line, free, limit):
    """Lowers a row of cells; True where a surface among them was lost. Kept free of branches."""
    lost = 0
    for c in range(len(line)):
        old = np.int32(line[c])
        new = max((np.int32(0) if old == UNKNOWN else old) - free, -limit)
        line[c] = new
        lost += (old > 0) & (new <= 0)
    return lost > 0


@kernel
def _note_removals(removed, count, line, free, row, column):
    """Appends the cells of a row just lowered that were surfaces before; returns array and count."""
    if count + len(line) > len(removed):
        larger = np.empty((2 * (count + len(line)), 2), np.int64)
        larger[:count] = removed[:count]
        removed = larger
    for c in range(len(line)):
        if line[c] <= 0 and line[c] + free > 0:
            removed[count, 0], removed[count, 1] = row, column + c
            count += 1
    return removed, count


@kernel
def _update_blocks(field, blocks, tile):
    size = field.shape[1] // blocks.shape[1]
    for block_row in range(blocks.shape[1]):
        for block_column in range(blocks.shape[2]):
            largest = np.uint8(0)
            for r in range(block_row * size, (block_row + 1) * size):
                for c in range(block_column * size, (block_column + 1) * size):
                    largest = max(largest, field[tile, r, c])
            blocks[tile, block_row, block_column] = largest
