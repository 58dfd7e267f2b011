"""What one update does to one particle: match, propose and draw; then integrate (Algorithm 1)."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from gridwright_server.jit import kernel
from gridwright_server.slam.grid.maps import Grid, Maps, View, corner_m_of
from gridwright_server.slam.grid.occupancy import cells_seen, integrate, tiles_wanted
from gridwright_server.slam.grid.patch import gather, new_patch, tiles_reached
from gridwright_server.slam.matching.match import Matching, find, mean_field
from gridwright_server.slam.matching.refine import interpolated_sum
from gridwright_server.slam.proposal import Proposal, covariance_of, draw, fit
from gridwright_server.slam.se2 import wrap
from gridwright_server.slam.types import Pose


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
        corner_m = corner_m_of(maps, p, resolution)
        expected = predicted[p].copy()
        expected[:2] = (expected[:2] - corner_m) / resolution
        match, score, quarters = find(maps, p, expected, view, grid, matching, patch)
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


@kernel
def fit_at(maps: Maps, p: int, pose: Pose, points: NDArray[np.float64], grid: Grid) -> float:
    """How well a scan's points fit the map of particle p from a pose, map_from_base: 1 = all on surfaces."""
    patch = new_patch(maps.tables.shape[1], grid)
    local = pose.copy()
    local[:2] = (local[:2] - corner_m_of(maps, p, grid.resolution_m)) / grid.resolution_m
    tiles_reached(points, local, 2, 0.0, grid, patch.reached)
    gather(maps.arrays.field, maps.tables[p], patch.reached, patch.field)
    return mean_field(patch.field, points, local, grid.resolution_m)
