"""What one update does to one particle: match, propose and draw; then integrate (Algorithm 1)."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.occupancy import cells_seen, integrate, tiles_wanted
from gridwright_server.slam.grid.patch import gather, reachable_maximum, tiles_reached
from gridwright_server.slam.grid.tiles import TileArrays
from gridwright_server.slam.matching.multilevel import CoarseLevel, Objective, Window, search
from gridwright_server.slam.matching.refine import CLIMB_LIMIT, climb, interpolated_sum
from gridwright_server.slam.proposal import Lattice, Proposal, covariance_of, draw, fit
from gridwright_server.slam.se2 import wrap
from gridwright_server.slam.types import Pose

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
    wide_window: Window
    """Searched where the window holds no match, or one at its border."""
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


class Patch(NamedTuple):
    """The part of a particle's map around its pose, laid out densely; storage used again and again."""

    field: NDArray[np.uint8]
    blocks: NDArray[np.uint8]
    scratch: NDArray[np.uint8]
    reached: NDArray[np.bool_]
    level: CoarseLevel


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
    resolution = grid.resolution_m
    patch = new_patch(maps.tables.shape[1], grid)
    for p in range(begin, end):
        # From here on poses are (column, row, theta), in cells counted from the patch's corner.
        corner_m = _corner_m(maps, p, resolution)
        expected = predicted[p].copy()
        expected[:2] = (expected[:2] - corner_m) / resolution
        match, score, quarters = _find(maps, p, expected, view, grid, matching, patch)
        if score < matching.minimum_score:  # lines 6-8
            proposal = _motion_proposal(maps, p, expected, draws[p], view, grid, matching, patch)
        else:  # lines 9-33
            proposal = fit(
                patch.field, view.points, match, expected, resolution, matching.objective, matching.lattice
            )
        drawn = draw(proposal.mean, proposal.factor, draws[p])
        _to_map(drawn, corner_m, resolution, out.poses[p])
        _to_map(proposal.mean, corner_m, resolution, out.means[p])
        proposal.factor[:2] *= resolution
        out.covariances[p] = covariance_of(proposal.factor)
        out.log_weights[p] = proposal.log_eta
        out.scores[p], out.quarters[p] = score, quarters


@kernel
def _find(maps, p, expected, view, grid, matching, patch):
    """The match and its score, and how many quarters were scored for it.

    Where the window holds none, or one at its border, odometry may be wrong, not only noisy: the wide
    window is searched too.
    """
    match, score, at_border, quarters = _match(
        maps, p, expected, view, grid, matching, matching.window, patch
    )
    if at_border or score < matching.minimum_score:
        match, score, _, more = _match(maps, p, expected, view, grid, matching, matching.wide_window, patch)
        quarters += more
    return match, score, quarters


@kernel
def _motion_proposal(maps, p, expected, normals, view, grid, matching, patch):
    """The motion model, for want of a match; weighed at the pose that `normals` draw from it."""
    factor = np.zeros((3, 3))
    factor[0, 0] = factor[1, 1] = matching.translation_sigma_m / grid.resolution_m
    factor[2, 2] = matching.rotation_sigma_rad
    drawn = draw(expected, factor, normals)
    # The draw may lead beyond what was laid out for the search.
    tiles_reached(view.points, drawn, 2, 0.0, grid, patch.reached)
    gather(maps.arrays.field, maps.tables[p], patch.reached, patch.field)
    total = interpolated_sum(patch.field, view.points, drawn[0], drawn[1], drawn[2], grid.resolution_m)
    return Proposal(expected, factor, matching.objective.likelihood_scale * total)


@kernel
def _match(maps, p, expected, view, grid, matching, window, patch):
    """The best pose of a window around the expected one, refined.

    Returns (column, row, theta), its score, whether it lies at the window's border, and the number of
    quarters scored.
    """
    resolution = grid.resolution_m
    _lay_out(maps, p, expected, view, grid, matching.lattice, window, patch)
    found = search(patch.field, patch.level, view.points, expected, resolution, window, matching.objective)
    best = expected.copy()
    best[0] += found.column
    best[1] += found.row
    best[2] += found.step * window.angle_step_rad
    match = climb(patch.field, view.points, best, expected, resolution, window, matching.objective)
    score = mean_field(patch.field, view.points, match, resolution)
    return match, score, _is_at_border(found, window), found.quarters_scored


@kernel
def _is_at_border(found, window):
    first, last = -window.half_voxels * window.coarse, window.half_voxels * window.coarse - 1
    return found.row in (first, last) or found.column in (first, last) or abs(found.step) == window.half_steps


@kernel
def mean_field(field, points, pose, resolution_m):
    """How well a scan fits at a pose, (column, row, theta) in cells of the patch: 1 = all on surfaces."""
    total = interpolated_sum(field, points, pose[0], pose[1], pose[2], resolution_m)
    return total / (FULL_SCORE * max(len(points), 1))


@kernel
def new_patch(size, grid):
    """Storage for the part of a map that `size` x `size` tiles cover."""
    blocks_along = size * grid.tile_cells // grid.block_cells
    blocks = np.empty((blocks_along, blocks_along), np.uint8)
    return Patch(
        np.empty((size * grid.tile_cells, size * grid.tile_cells), np.uint8),
        blocks,
        np.empty_like(blocks),
        np.empty((size, size), np.bool_),
        CoarseLevel(grid.block_cells, np.empty_like(blocks), np.empty_like(blocks)),
    )


@kernel
def _lay_out(maps, p, expected, view, grid, lattice, window, patch):
    """Fills a patch with what a search of the window can reach of the particle's map."""
    slack_cells = search_slack_cells(window, grid.block_cells, lattice)
    slack_rad = (window.half_steps + CLIMB_LIMIT) * window.angle_step_rad + lattice.extent[2]
    tiles_reached(view.points, expected, slack_cells, slack_rad, grid, patch.reached)
    gather(maps.arrays.field, maps.tables[p], patch.reached, patch.field)
    gather(maps.arrays.blocks, maps.tables[p], patch.reached, patch.blocks)
    reachable_maximum(patch.blocks, grid.block_cells, window.coarse, patch.scratch, patch.level.voxel)
    reachable_maximum(patch.blocks, grid.block_cells, window.quarter, patch.scratch, patch.level.quarter)


@kernel
def fit_at(maps: Maps, p: int, pose: Pose, points: NDArray[np.float64], grid: Grid) -> float:
    """How well a scan's points fit the map of particle p from a pose, map_from_base: 1 = all on surfaces."""
    patch = new_patch(maps.tables.shape[1], grid)
    local = pose.copy()
    local[:2] = (local[:2] - _corner_m(maps, p, grid.resolution_m)) / grid.resolution_m
    tiles_reached(points, local, 2, 0.0, grid, patch.reached)
    gather(maps.arrays.field, maps.tables[p], patch.reached, patch.field)
    return mean_field(patch.field, points, local, grid.resolution_m)


@kernel
def _corner_m(maps, p, resolution_m):
    """x and y of the first corner of a particle's part of the map."""
    return np.array((maps.first_cells[p, 1] * resolution_m, maps.first_cells[p, 0] * resolution_m))


@kernel
def search_slack_cells(window: Window, block_cells: int, lattice: Lattice) -> int:
    """How far from where it falls at the predicted pose matching may look up an end point.

    The window; what a square of poses reaches beyond it, in whole blocks; then climbing, the lattice
    of the proposal and, twice, a cell for interpolation.
    """
    beyond = window.coarse + 2 * block_cells + CLIMB_LIMIT + 2
    return window.half_voxels * window.coarse + beyond + math.ceil(lattice.extent[0])


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
