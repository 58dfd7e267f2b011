"""Tiles shared copy-on-write against particles that own copies of everything."""

import numpy as np
import pytest
from gridwright_server.errors import ResourceExhaustedError
from gridwright_server.slam.grid.lattice import MAXIMUM_CELLS, Box, PageTables, Places, places_around
from gridwright_server.slam.grid.occupancy import occupancy_percent
from gridwright_server.slam.grid.tiles import NO_TILE, UNKNOWN, TilePool
from gridwright_server.slam.snapshot import TileSnapshot
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from naive.own_copies import OwnCopies, recount

PARTICLES, TILE_CELLS, BLOCK_CELLS = 4, 4, 2
EMPTY = (
    np.full((4, 4), UNKNOWN, np.int16),
    np.zeros((4, 4), np.uint8),
    np.zeros((2, 2), np.uint8),
)
indices = st.integers(0, PARTICLES - 1)
places = st.tuples(st.integers(-3, 3), st.integers(-3, 3))


class SharedTiles(RuleBasedStateMachine):
    def __init__(self):
        super().__init__()
        self.pool = TilePool(TILE_CELLS, BLOCK_CELLS, capacity=2)
        self.pages = PageTables(PARTICLES, self.pool)
        self.naive = OwnCopies(PARTICLES)
        self.snapshots = []
        self.given_back = []

    @rule(particle=indices, at=st.sets(places, min_size=1, max_size=6), seed=st.integers(0, 99))
    def write(self, particle, at, seed):
        """As an update does: room, tiles of its own, then new contents."""
        rows, columns = [row for row, _ in at], [column for _, column in at]
        box = Box(min(rows), min(columns), max(rows) + 1, max(columns) + 1)
        self.pages.cover(box)
        size = max(box.shape)
        self.pages.cover(Box(box.row_begin, box.column_begin, box.row_begin + size, box.column_begin + size))
        corner = np.array([[box.row_begin, box.column_begin]] * PARTICLES)
        parts = self.pages.parts(Places(corner, size))
        table = parts[particle]
        wanted = np.zeros((size, size), np.bool_)
        for row, column in at:
            wanted[row - box.row_begin, column - box.column_begin] = True
        self.pool.make_writable(table, wanted)
        self.pages.replace(Places(corner, size), parts)
        self.given_back.clear()
        rng = np.random.default_rng(seed)
        for row, column in sorted(at):
            tile = table[row - box.row_begin, column - box.column_begin]
            old = self.naive.maps[particle].get((row, column), EMPTY)
            content = [old[0].copy(), old[1].copy(), old[2].copy()]
            # A corner of each: what is not written must have come along.
            content[0][:2, :2] = rng.integers(-4000, 4000, (2, 2))
            content[1][1:3, 1:3] = rng.integers(0, 255, (2, 2))
            content[2][0, 0] = rng.integers(0, 255)
            arrays = self.pool.arrays
            arrays.log_odds[tile, :2, :2] = content[0][:2, :2]
            arrays.field[tile, 1:3, 1:3] = content[1][1:3, 1:3]
            arrays.blocks[tile, 0, 0] = content[2][0, 0]
            self.naive.write(particle, (row, column), content)

    @rule(ancestors=st.lists(indices, min_size=PARTICLES, max_size=PARTICLES))
    def resample(self, ancestors):
        self.pages.resample(np.array(ancestors))
        self.naive.resample(ancestors)

    @rule(row=st.integers(-6, 5), column=st.integers(-6, 5), size=st.integers(0, 3))
    def grow(self, row, column, size):
        self.pages.cover(Box(row, column, row + size, column + size))

    @rule(particle=indices)
    def take_snapshot(self, particle):
        self.snapshots.append(TileSnapshot(self.pool, self.pages, particle, 0.1, 5, 6, 7))
        self.naive.take(particle)

    @precondition(lambda self: self.snapshots)
    @rule(data=st.data(), times=st.integers(1, 2))
    def close_snapshot(self, data, times):
        index = data.draw(st.integers(0, len(self.snapshots) - 1))
        self.given_back.append(self.snapshots[index]._tiles)
        for _ in range(times):
            self.snapshots[index].close()
        del self.snapshots[index], self.naive.snapshots[index]

    @rule()
    def take_up_what_was_given_back(self):
        self.pool.reserve(0)
        self.given_back.clear()

    @invariant()
    def counts_equal_a_recount(self):
        held = [snapshot._tiles for snapshot in self.snapshots] + self.given_back
        references = self.pool.references.tolist()
        assert references == recount(self.pages.tables, held, len(references))
        free = self.pool._free[: self.pool._free_count].tolist()
        assert sorted(free) == [tile for tile, count in enumerate(references) if count == 0]
        assert self.pool.used == len(references) - len(free)

    @invariant()
    def each_reads_what_it_wrote(self):
        window = self.pages.window
        for particle, expected in enumerate(self.naive.maps):
            rows, columns = np.nonzero(self.pages.tables[particle] != NO_TILE)
            actual = {}
            for row, column in zip(rows, columns, strict=True):
                tile = self.pages.tables[particle, row, column]
                actual[row + window.row_begin, column + window.column_begin] = tile
            assert actual.keys() == expected.keys()
            for place, content in expected.items():
                for array, part in zip(self.pool.arrays, content, strict=True):
                    np.testing.assert_array_equal(array[actual[place]], part)

    @invariant()
    def snapshots_read_what_there_was(self):
        for snapshot, expected in zip(self.snapshots, self.naive.snapshots, strict=True):
            origins = [tuple(origin) for origin in snapshot.tile_origins.tolist()]
            assert origins == [(column * 4, row * 4) for row, column in sorted(expected)]
            for tile, place in enumerate(sorted(expected)):
                np.testing.assert_array_equal(snapshot.occupancy(tile), occupancy_percent(expected[place][0]))


TestSharedTiles = SharedTiles.TestCase
TestSharedTiles.settings = settings(deadline=None, max_examples=60, stateful_step_count=30)


@settings(deadline=None)
@given(
    st.lists(st.tuples(st.floats(-50, 50), st.floats(-50, 50), st.floats(-4, 4)), min_size=1, max_size=5).map(
        np.array
    ),
    st.floats(0.0, 30.0),
)
def test_places_hold_everything_within_the_radius(poses, radius_m):
    tile_m = 1.6
    around = places_around(poses, radius_m, tile_m)
    low = around.first_tiles[:, ::-1] * tile_m
    high = low + around.size * tile_m
    assert (low <= poses[:, :2] - radius_m + 1e-9).all()
    assert (high >= poses[:, :2] + radius_m - 1e-9).all()
    for row, column in around.first_tiles:
        inside = Box(row, column, row + around.size, column + around.size)
        assert around.box.union(inside) == around.box


def test_a_union_with_nothing_is_itself():
    box, nothing = Box(-3, 4, 5, 6), Box(0, 0, 0, 0)
    assert box.union(nothing) == nothing.union(box) == box


def test_a_box_beyond_the_limit_is_refused_and_changes_nothing():
    pool = TilePool(32, 4, capacity=2)
    pages = PageTables(2, pool)
    pages.cover(Box(0, 0, 4, 4))
    side = int(np.sqrt(MAXIMUM_CELLS)) // 32
    pages.check(Box(0, 0, side, side))
    for box in (Box(0, 0, side, side + 1), Box(10**6, 0, 10**6 + 1, 1)):
        with pytest.raises(ResourceExhaustedError):
            pages.check(box)
    assert pages.window == Box(0, 0, 4, 4)
    assert pages.tables.shape == (2, 4, 4)
