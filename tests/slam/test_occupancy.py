"""A map after many scans against the same map kept cell by cell and derived anew."""

import numpy as np
import pytest
from gridwright_server.config import SensorConfig
from gridwright_server.slam.grid.lattice import PageTables, places_around
from gridwright_server.slam.grid.likelihood import likelihood_model
from gridwright_server.slam.grid.maps import Grid
from gridwright_server.slam.grid.occupancy import (
    LOG_ODDS_UNIT,
    cells_seen,
    integrate,
    log_odds_units,
    occupancy_percent,
    tiles_wanted,
)
from gridwright_server.slam.grid.sector import sector_outline
from gridwright_server.slam.grid.tiles import NO_TILE, UNKNOWN, TilePool
from naive.one_map import OneMap, block_maxima, cells_of_scan, field_of

RESOLUTION_M, TILE_CELLS, BLOCK_CELLS = 0.1, 12, 4
SENSOR = SensorConfig(hit_sigma_meters=0.12)


def dense(pages, tiles, unknown, shrink=1):
    """One array of a particle's whole window; `unknown` where there is no tile."""
    n = TILE_CELLS // shrink
    rows, columns = pages.window.shape
    out = np.full((rows * n, columns * n), unknown, tiles.dtype)
    for row in range(rows):
        for column in range(columns):
            tile = pages.tables[0, row, column]
            if tile != NO_TILE:
                out[row * n : (row + 1) * n, column * n : (column + 1) * n] = tiles[tile]
    return out


class Both:
    """The kernels' map and its twin."""

    def __init__(self, free, hit, limit):
        self.model = likelihood_model(SENSOR, RESOLUTION_M)
        self.grid = Grid(RESOLUTION_M, TILE_CELLS, BLOCK_CELLS, free, hit, limit, self.model.stamp)
        self.pool = TilePool(TILE_CELLS, BLOCK_CELLS, capacity=4)
        self.pages = PageTables(1, self.pool)
        self.naive = OneMap(free, hit, limit)

    def scan(self, pose, bearings, ranges):
        hit = ranges > 0.0
        points = np.stack([ranges * np.cos(bearings), ranges * np.sin(bearings)], axis=1)[hit]
        outline = sector_outline(bearings, ranges, RESOLUTION_M, np.zeros(2))
        radius = self.model.radius
        reach_m = ranges.max(initial=0.0) + (2 * radius + 2) * RESOLUTION_M
        places = places_around(pose[np.newaxis], reach_m, TILE_CELLS * RESOLUTION_M)
        self.pages.cover(places.box)
        parts, first_cell = self.pages.parts(places), places.first_tiles[0] * TILE_CELLS
        table = parts[0]
        runs, hits = cells_seen(outline, points, pose, RESOLUTION_M)
        wanted = np.zeros(table.shape, np.bool_)
        tiles_wanted(runs, hits, radius, TILE_CELLS, first_cell, wanted)
        self.pool.make_writable(table, wanted)
        self.pages.replace(places, parts)
        integrate(self.pool.arrays, table, first_cell, runs, hits, self.grid)
        self.naive.integrate(*cells_of_scan(outline, points, pose, RESOLUTION_M))

    def assert_same(self):
        window, arrays = self.pages.window, self.pool.arrays
        rows = np.arange(window.row_begin * TILE_CELLS, window.row_end * TILE_CELLS)
        columns = np.arange(window.column_begin * TILE_CELLS, window.column_end * TILE_CELLS)
        log_odds = np.full((len(rows), len(columns)), UNKNOWN)
        for (row, column), value in self.naive.log_odds.items():
            log_odds[row - rows[0], column - columns[0]] = value
        np.testing.assert_array_equal(dense(self.pages, arrays.log_odds, UNKNOWN), log_odds)
        field = field_of(
            self.naive.surfaces(),
            rows,
            columns,
            RESOLUTION_M,
            SENSOR.hit_sigma_meters,
            SENSOR.outlier_probability,
        )
        np.testing.assert_array_equal(dense(self.pages, arrays.field, 0), field)
        blocks = dense(self.pages, arrays.blocks, 0, BLOCK_CELLS)
        np.testing.assert_array_equal(blocks, block_maxima(field, BLOCK_CELLS))


def random_scan(rng):
    beams = int(rng.integers(2, 50))
    bearings = np.linspace(0.0, rng.uniform(0.5, 2.0 * np.pi), beams)
    smooth = np.interp(bearings, np.linspace(0.0, 7.0, 8), rng.uniform(0.2, 3.0, 8))
    ranges = np.where(rng.random(beams) < 0.15, 0.0, smooth)
    return bearings if rng.random() < 0.5 else bearings[::-1].copy(), ranges


@pytest.mark.parametrize(
    ("free", "hit", "limit"),
    [(80, 900, 4000), (500, 900, 2000), (900, 300, 1000), (5000, 7000, 1000), (1, 1, 20_000)],
)
@pytest.mark.parametrize("seed", range(4))
def test_log_odds_field_and_blocks_after_random_scans(free, hit, limit, seed):
    rng = np.random.default_rng([seed, free])
    both = Both(free, hit, limit)
    ever_surfaces, vanished = set(), False
    for _ in range(25):
        pose = np.array((*rng.uniform(-3.0, 3.0, 2), rng.uniform(-4.0, 4.0)))
        both.scan(pose, *random_scan(rng))
        surfaces = set(both.naive.surfaces())
        vanished |= not ever_surfaces <= surfaces
        ever_surfaces |= surfaces
        both.assert_same()
    assert ever_surfaces
    assert vanished or free < 100


def test_a_door_that_opens_leaves_no_trace_in_the_field():
    both = Both(free=400, hit=900, limit=2000)
    bearings = np.linspace(-0.8, 0.8, 65)
    wall, door = 2.0 / np.cos(bearings), np.abs(bearings) < 0.3
    pose = np.array((0.37, -0.21, 0.9))
    both.scan(pose, bearings, np.where(door, 1.5, wall))
    both.assert_same()
    before = len(both.naive.surfaces())
    for _ in range(8):
        both.scan(pose, bearings, wall)
        both.assert_same()
    assert both.naive.surfaces()
    assert before > 20
    x, y = 1.5 * np.cos(0.9) + 0.37, 1.5 * np.sin(0.9) - 0.21
    door_cell = (int(np.floor(y / RESOLUTION_M)), int(np.floor(x / RESOLUTION_M)))
    assert both.naive.log_odds[door_cell] == -2000


def test_negative_coordinates_are_cells_like_others():
    """The lattice has no seam at zero: a scan moved by whole cells makes the same map, moved."""
    rng = np.random.default_rng(9)
    scans = [
        (np.array((*rng.uniform(-1.0, 1.0, 2), rng.uniform(-3.0, 3.0))), random_scan(rng)) for _ in range(6)
    ]
    for shift_m in (-100.0, 0.0, 37.0):
        both = Both(300, 900, 2000)
        for pose, scan in scans:
            both.scan(pose + np.array((shift_m, shift_m, 0.0)), *scan)
        both.assert_same()


def test_scans_without_returns_say_nothing():
    both = Both(80, 900, 4000)
    both.scan(np.zeros(3), np.linspace(-1.0, 1.0, 20), np.zeros(20))
    assert not both.naive.log_odds
    both.assert_same()


def test_a_lone_surface_wears_the_stamp():
    model = likelihood_model(SensorConfig(), 0.04)
    radius = model.radius
    side = np.arange(-radius, radius + 1)
    expected = field_of([(0, 0)], side, side, 0.04, 0.06, 0.05)
    np.testing.assert_array_equal(model.stamp, expected)
    assert model.stamp[radius, radius] == 255
    wider = np.arange(-radius - 1, radius + 2)
    around = field_of([(0, 0)], wider, wider, 0.04, 0.06, 0.05)
    assert around[0].max() == around[:, 0].max() == 0  # nothing of the table is cut off


def test_a_field_step_is_a_255th_of_the_range_of_log_likelihoods():
    model = likelihood_model(SensorConfig(outlier_probability=0.05), 0.04)
    assert model.log_likelihood_per_step * 255 == pytest.approx(-np.log(0.05))


def test_percent():
    log_odds = np.array([UNKNOWN, -32_000, -4000, -1, 0, 1, 4000, 20_000, 32_000], np.int16)
    percent = occupancy_percent(log_odds)
    assert percent.dtype == np.int8
    assert percent.tolist() == [-1, 0, 2, 50, 50, 50, 98, 100, 100]
    every = occupancy_percent(np.arange(-20_000, 20_001).astype(np.int16))
    assert (np.diff(every) >= 0).all()
    odds = np.exp(np.arange(-20_000, 20_001) * LOG_ODDS_UNIT)
    np.testing.assert_allclose(every / 100.0, odds / (1.0 + odds), atol=0.005 + 1e-9)


def test_units_are_whole_and_round():
    assert [log_odds_units(x) for x in (0.9, 0.08, 4.0, 0.0104)] == [900, 80, 4000, 10]
