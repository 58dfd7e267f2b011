"""The observed part of a map, and its fingerprint."""

import dataclasses
import hashlib

import numpy as np

from gridwright_client.results import OccupancyMap

UNKNOWN = -1


def cropped(grid: OccupancyMap) -> OccupancyMap:
    """The smallest box that holds every cell that is not unknown; 0 x 0 cells where there is none."""
    is_known = grid.cells != UNKNOWN
    rows, columns = np.flatnonzero(is_known.any(axis=1)), np.flatnonzero(is_known.any(axis=0))
    if rows.size == 0:
        return dataclasses.replace(grid, cells=grid.cells[:0, :0], min_column=0, min_row=0)
    box = grid.cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return dataclasses.replace(
        grid,
        cells=np.ascontiguousarray(box),
        min_column=grid.min_column + int(columns[0]),
        min_row=grid.min_row + int(rows[0]),
    )


def map_sha256(grid: OccupancyMap) -> str:
    """The fingerprint of a map, independent of how it was cut into tiles.

    SHA-256 of the ASCII line `resolution min_column min_row columns rows` and a newline, then of the
    cells as signed bytes, row by row from the lowest y: all of the cropped map, the resolution as
    Python's shortest text of the float64 in metres.
    """
    box = cropped(grid)
    rows, columns = box.cells.shape
    header = f"{box.resolution_m!r} {box.min_column} {box.min_row} {columns} {rows}\n"
    digest = hashlib.sha256(header.encode("ascii"))
    digest.update(np.ascontiguousarray(box.cells, dtype=np.int8).tobytes())
    return digest.hexdigest()
