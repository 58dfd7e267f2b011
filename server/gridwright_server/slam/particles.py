"""What one update does to one particle: match, propose and draw; then integrate (Algorithm 1)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.occupancy import cells_seen, integrate, tiles_wanted
from gridwright_server.slam.grid.patch import gather, reachable_maximum, tiles_reached
from gridwright_server.slam.grid.tiles import TileArrays
from gridwright_server.slam.matching.multilevel import CoarseLevel, Objective, Window, search
from gridwright_server.slam.matching.refine import climb, interpolated_sum
from gridwright_server.slam.proposal import Lattice, covariance_of, draw, fit
from gridwright_server.slam.se2 import wrap

FULL_SCORE = 255.0
"""The field on a surface."""


class Grid(NamedTuple):
    """Geometry of the maps and the model of their update; the same for all particles."""

    resolution_m: float
    tile_cells: int
    block_cells: int
    free: int
    """What a cell loses when a beam crosses it, in LOG_ODDS_UNIT; and what it gains when hit."""
    hit: int
    limit: int
    """Log-odds stay within +- this."""
    stamp: NDArray[np.uint8]
    """The likelihood field around a lone surface."""


class View(NamedTuple):
    """The scan as all particles see it, in base_link."""

    points: NDArray[np.float64]
    """shape (returns, 2): what the beams hit"""
    outline: NDArray[np.float64]
    """shape (corners, 2): the polygon seen free"""


class Matching(NamedTuple):
    """How to match a scan and how to draw from what is found."""

    window: Window
    objective: Objective
    lattice: Lattice
    minimum_score: float
    translation_sigma_m: float
    """Of the motion model, for particles whose match fails."""
    rotation_sigma_rad: float


class Proposed(NamedTuple):
    """Where the particles go; first axis: the particle."""

    poses: NDArray[np.float64]
    """shape (particles, 3), map_from_base, drawn"""
    means: NDArray[np.float64]
    """shape (particles, 3): what the poses were drawn around"""
    covariances: NDArray[np.float64]
    """shape (particles, 3, 3), in m and rad"""
    log_weights: NDArray[np.float64]
    """log eta (4.13); where the match failed, the tempered log p(z | m, x)"""
    scores: NDArray[np.float64]
    """mean field of an end point at the match, 0..1"""
    quarters: NDArray[np.int64]
    """how many quarters of voxels the search had to score; see matching.multilevel"""


class Maps(NamedTuple):
    """Each particle's map around its pose."""

    arrays: TileArrays
    tables: NDArray[np.int32]
    """shape (particles, size, size): page tables"""
    first_cells: NDArray[np.int64]
    """shape (particles, 2): lattice row and column of the first cell of each page table"""


@kernel
def propose(
    maps: Maps,
    predicted: NDArray[np.float64],
    draws: NDArray[np.float64],
    view: View,
    grid: Grid,
    matching: Matching,
    begin: int,
    end: int,
    out: Proposed,
) -> None:
    """Matches and draws the particles begin..end; writes only those rows of `out`, a Proposed.

    predicted: shape (particles, 3), map_from_base; draws: shape (particles, 3), standard normal.
    """
    resolution, window = grid.resolution_m, matching.window
    size, n = maps.tables.shape[1], grid.tile_cells
    blocks_along = size * n // grid.block_cells
    field = np.empty((size * n, size * n), np.uint8)
    blocks = np.empty((blocks_along, blocks_along), np.uint8)
    scratch = np.empty_like(blocks)
    level = CoarseLevel(grid.block_cells, np.empty_like(blocks), np.empty_like(blocks))
    reached = np.empty((size, size), np.bool_)
    slack_m = search_slack_cells(window, grid.block_cells) * resolution
    slack_rad = (window.half_steps + 2) * window.angle_step_rad
    for p in range(begin, end):
        table = maps.tables[p]
        # From here on poses are (column, row, theta), in cells counted from the patch's corner.
        corner_m = np.array((maps.first_cells[p, 1] * resolution, maps.first_cells[p, 0] * resolution))
        expected = predicted[p].copy()
        expected[:2] -= corner_m
        tiles_reached(view.points, expected, slack_m, slack_rad, n * resolution, reached)
        expected[:2] /= resolution
        gather(maps.arrays.field, table, reached, field)
        gather(maps.arrays.blocks, table, reached, blocks)
        reachable_maximum(blocks, grid.block_cells, window.coarse, scratch, level.voxel)
        reachable_maximum(blocks, grid.block_cells, window.quarter, scratch, level.quarter)

        found = search(field, level, view.points, expected, resolution, window, matching.objective)
        best = expected.copy()
        best[0] += found.column
        best[1] += found.row
        best[2] += found.step * window.angle_step_rad
        match = climb(field, view.points, best, expected, resolution, window, matching.objective)
        total = interpolated_sum(field, view.points, match[0], match[1], match[2], resolution)
        out.scores[p] = total / (FULL_SCORE * max(len(view.points), 1))
        out.quarters[p] = found.quarters_scored

        if out.scores[p] < matching.minimum_score:  # the match failed: trust the motion model (lines 6-8)
            mean, factor = expected, _motion_factor(matching, resolution)
        else:  # lines 9-33
            proposal = fit(
                field, view.points, match, expected, resolution, matching.objective, matching.lattice
            )
            mean, factor = proposal.mean, proposal.factor
        drawn = draw(mean, factor, draws[p])
        if out.scores[p] < matching.minimum_score:
            total = interpolated_sum(field, view.points, drawn[0], drawn[1], drawn[2], resolution)
            out.log_weights[p] = matching.objective.likelihood_scale * total
        else:
            out.log_weights[p] = proposal.log_eta
        _to_map(drawn, corner_m, resolution, out.poses[p])
        _to_map(mean, corner_m, resolution, out.means[p])
        factor[:2] *= resolution
        out.covariances[p] = covariance_of(factor)


@kernel
def search_slack_cells(window: Window, block_cells: int) -> int:
    """How far from where it falls at the predicted pose the search may look up an end point.

    The window itself; what a square of poses reaches beyond it; climbing and drawing, a few cells.
    """
    return (window.half_voxels + 2) * window.coarse + 2 * block_cells + 8


@kernel
def _motion_factor(matching, resolution_m):
    factor = np.zeros((3, 3))
    factor[0, 0] = factor[1, 1] = matching.translation_sigma_m / resolution_m
    factor[2, 2] = matching.rotation_sigma_rad
    return factor


@kernel
def _to_map(pose, corner_m, resolution_m, out):
    """From (column, row, theta) in cells of the patch to map_from_base."""
    out[0] = corner_m[0] + pose[0] * resolution_m
    out[1] = corner_m[1] + pose[1] * resolution_m
    out[2] = wrap(pose[2])


@kernel
def want(
    maps: Maps,
    poses: NDArray[np.float64],
    view: View,
    grid: Grid,
    begin: int,
    end: int,
    wanted: NDArray[np.bool_],
) -> None:
    """Marks the tiles that integrating the scan may write; bool, shape as maps.tables."""
    radius = grid.stamp.shape[0] // 2
    for p in range(begin, end):
        runs, hits = cells_seen(view.outline, view.points, poses[p], grid.resolution_m)
        tiles_wanted(runs, hits, radius, grid.tile_cells, maps.first_cells[p], wanted[p])


@kernel
def integrate_scan(
    maps: Maps, poses: NDArray[np.float64], view: View, grid: Grid, begin: int, end: int
) -> None:
    """Integrates the scan into the maps of the particles begin..end (line 36).

    Every wanted tile must be the particle's own.
    """
    for p in range(begin, end):
        runs, hits = cells_seen(view.outline, view.points, poses[p], grid.resolution_m)
        integrate(maps.arrays, maps.tables[p], maps.first_cells[p], runs, hits, grid)
