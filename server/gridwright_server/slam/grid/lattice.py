"""Page tables of all particles over one window of the lattice."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.errors import ResourceExhaustedError
from gridwright_server.slam.grid.tiles import NO_TILE, TilePool

MAXIMUM_CELLS = 256 * 2**20
"""Cells of the largest box a session's map may span: 655 m x 655 m at 4 cm.

The page tables are dense; the limit keeps each particle's below 1 MiB, whatever odometry claims.
"""


class Box(NamedTuple):
    """A box of tiles: [row_begin, row_end) x [column_begin, column_end), in tile indices of the lattice."""

    row_begin: int
    column_begin: int
    row_end: int
    column_end: int

    def union(self, other: "Box") -> "Box":
        """The smallest box that holds both; an empty one adds nothing."""
        if self.tiles == 0:
            return other
        if other.tiles == 0:
            return self
        return Box(
            min(self.row_begin, other.row_begin),
            min(self.column_begin, other.column_begin),
            max(self.row_end, other.row_end),
            max(self.column_end, other.column_end),
        )

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of tiles."""
        return self.row_end - self.row_begin, self.column_end - self.column_begin

    @property
    def tiles(self) -> int:
        """How many tiles it spans."""
        return self.shape[0] * self.shape[1]


class Places(NamedTuple):
    """The square part of each particle's map around a pose of its own."""

    first_tiles: NDArray[np.int64]
    """shape (particles, 2): lattice row and column of each part's first tile"""
    size: int
    """Tiles along the side of a part."""

    @property
    def box(self) -> Box:
        """The smallest box that holds all parts."""
        low, high = self.first_tiles.min(axis=0), self.first_tiles.max(axis=0) + self.size
        return Box(int(low[0]), int(low[1]), int(high[0]), int(high[1]))


def places_around(poses: NDArray[np.float64], radius_m: float, tile_m: float) -> Places:
    """Parts that hold everything within radius_m of the poses, shape (particles, 3)."""
    first_tiles = np.floor((poses[:, 1::-1] - radius_m) / tile_m).astype(np.int64)
    return Places(first_tiles, int(2.0 * radius_m / tile_m) + 2)


class PageTables:
    """tables[particle, row, column]: the tile at the lattice's tile (window.row_begin + row, ...).

    The window grows by whole tiles; no cell ever moves.
    """

    def __init__(self, particles: int, pool: TilePool) -> None:
        self.window = Box(0, 0, 0, 0)
        self.tables: NDArray[np.int32] = np.full((particles, 0, 0), NO_TILE, np.int32)
        self._pool = pool

    def check(self, box: Box) -> None:
        """Raises ResourceExhaustedError where the window could not hold `box` too."""
        if self.window.union(box).tiles * self._pool.tile_cells**2 > MAXIMUM_CELLS:
            raise ResourceExhaustedError(
                "MAP_TOO_LARGE", "the map would span more cells than a session may hold"
            )

    def cover(self, box: Box) -> None:
        """Makes the window hold `box`."""
        grown = self.window.union(box)
        if grown == self.window:
            return
        tables = np.full((len(self.tables), *grown.shape), NO_TILE, np.int32)
        rows, columns = self.window.shape
        row, column = self.window.row_begin - grown.row_begin, self.window.column_begin - grown.column_begin
        if rows and columns:
            tables[:, row : row + rows, column : column + columns] = self.tables
        self.tables, self.window = tables, grown

    def parts(self, places: Places) -> NDArray[np.int32]:
        """The page tables of all particles' parts; a copy, shape (particles, size, size)."""
        return np.stack([self._part(places, particle) for particle in range(len(self.tables))])

    def replace(self, places: Places, parts: NDArray[np.int32]) -> None:
        """Puts parts as of `parts` back."""
        for particle in range(len(self.tables)):
            self._part(places, particle)[:] = parts[particle]

    def _part(self, places: Places, particle: int) -> NDArray[np.int32]:
        row = places.first_tiles[particle, 0] - self.window.row_begin
        column = places.first_tiles[particle, 1] - self.window.column_begin
        return self.tables[particle, row : row + places.size, column : column + places.size]

    def resample(self, ancestors: NDArray[np.int64]) -> None:
        """Particle i becomes a copy of ancestors[i]: page tables are copied, tiles are shared."""
        copies = np.bincount(ancestors, minlength=len(self.tables))
        for particle in np.flatnonzero(copies > 1):
            self._pool.retain(self.tables[particle], int(copies[particle]) - 1)
        for particle in np.flatnonzero(copies == 0):
            self._pool.release(self.tables[particle])
        self.tables = self.tables[ancestors]
