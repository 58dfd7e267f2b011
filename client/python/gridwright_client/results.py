"""The map and the trajectory as arrays."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from gridwright.v1.mapping_service_pb2 import GetMapResponse, GetTrajectoryResponse, MapHeader, MapVersion
from numpy.typing import NDArray

from gridwright_client.items import nanoseconds


@dataclass(frozen=True)
class OccupancyMap:
    """A map in the frame `map`; row 0 has the lowest y, column 0 the lowest x."""

    cells: NDArray[np.int8]
    """shape (rows, columns): -1 unknown, 0..100 probability of being occupied in percent."""
    resolution_m: float
    min_column: int
    """`cells[row, column]` covers x from (min_column + column) * resolution_m."""
    min_row: int
    """`cells[row, column]` covers y from (min_row + row) * resolution_m."""
    stamp_ns: int
    version: MapVersion


@dataclass(frozen=True)
class Trajectory:
    """The best particle's path: a pose for every scan that was not rejected, in order of arrival."""

    stamps_ns: NDArray[np.int64]
    """shape (n,)"""
    poses: NDArray[np.float64]
    """shape (n, 3): x in m, y in m, theta in rad, of base_link in map."""
    processed: NDArray[np.bool_]
    """shape (n,); False where the motion filter skipped the scan."""


def assemble_map(responses: Iterable[GetMapResponse]) -> OccupancyMap:
    """Puts the tiles of one GetMap answer into one array."""
    header = MapHeader()
    cells = np.empty((0, 0), dtype=np.int8)
    for response in responses:
        if response.HasField("header"):
            header = response.header
            cells = np.full((header.rows, header.columns), -1, dtype=np.int8)
            continue
        side = header.tile_cells
        for tile in response.tiles.tiles:
            row, column = tile.min_row - header.min_row, tile.min_column - header.min_column
            block = np.frombuffer(tile.cells, dtype=np.int8).reshape(side, side)
            cells[row : row + side, column : column + side] = block
    return OccupancyMap(
        cells=cells,
        resolution_m=header.resolution_meters,
        min_column=header.min_column,
        min_row=header.min_row,
        stamp_ns=nanoseconds(header.stamp),
        version=header.version,
    )


def assemble_trajectory(responses: Iterable[GetTrajectoryResponse]) -> Trajectory:
    """Puts the poses of one GetTrajectory answer into arrays."""
    entries = [entry for response in responses for entry in response.poses]
    poses = [(entry.pose.x_meters, entry.pose.y_meters, entry.pose.theta_radians) for entry in entries]
    return Trajectory(
        stamps_ns=np.array([nanoseconds(entry.stamp) for entry in entries], dtype=np.int64),
        poses=np.array(poses, dtype=np.float64).reshape(-1, 3),
        processed=np.array([entry.processed for entry in entries], dtype=np.bool_),
    )
