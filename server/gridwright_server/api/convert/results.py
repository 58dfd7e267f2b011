"""The session's results to messages."""

import math
from collections.abc import Iterator

import numpy as np
from google.protobuf.timestamp_pb2 import Timestamp
from gridwright.v1 import mapping_service_pb2 as pb
from gridwright.v1.geometry_pb2 import Pose2D
from gridwright.v1.sensor_pb2 import Verdict as VerdictMessage
from numpy.typing import NDArray

from gridwright_server.session.items import Outcome
from gridwright_server.slam.types import MapSnapshot, PoseEstimate, Trajectory, Verdict

_NANOSECONDS = 1_000_000_000
_MAP_FRAME = "map"
_TILE_MESSAGE_BYTES = 512 * 1024  # well below what clients take by default
_POSES_PER_MESSAGE = 4096

_VERDICTS = {verdict: VerdictMessage.Value(f"VERDICT_{verdict.name}") for verdict in Verdict}


def timestamp(stamp_ns: int) -> Timestamp:
    """From nanoseconds since 1970."""
    seconds, nanos = divmod(int(stamp_ns), _NANOSECONDS)
    return Timestamp(seconds=seconds, nanos=nanos)


def pose_message(pose: NDArray[np.float64]) -> Pose2D:
    """From (x_m, y_m, theta_rad); the angle is brought into [-pi, pi)."""
    x, y, theta = pose.tolist()
    theta = math.remainder(theta, math.tau)
    return Pose2D(x_meters=x, y_meters=y, theta_radians=-math.pi if theta >= math.pi else theta)


def estimate_message(estimate: PoseEstimate) -> pb.PoseEstimate:
    """A pose with its uncertainty."""
    return pb.PoseEstimate(
        stamp=timestamp(estimate.stamp_ns),
        frame_id=_MAP_FRAME,
        child_frame_id="base_link",
        pose=pose_message(estimate.map_from_base),
        covariance=estimate.covariance.ravel().tolist(),
        map_from_odom=pose_message(estimate.map_from_odom),
        effective_sample_size=estimate.effective_sample_size,
        particle_count=estimate.particle_count,
    )


def verdict_value(verdict: Verdict) -> VerdictMessage.ValueType:
    """The wire's number."""
    return _VERDICTS[verdict]


def item_verdict(outcome: Outcome, want_pose: bool) -> pb.ItemVerdict:
    """The answer to one item of a stream."""
    message = pb.ItemVerdict(sequence_number=outcome.sequence_number or 0, verdict=_VERDICTS[outcome.verdict])
    for violation in outcome.violations:
        message.violations.add(field=violation.field, description=violation.description)
    if want_pose and outcome.estimate is not None:
        message.pose.CopyFrom(estimate_message(outcome.estimate))
    return message


def map_messages(snapshot: MapSnapshot, map_uid: str) -> Iterator[pb.GetMapResponse]:
    """A header, then the tiles, several to a message."""
    yield pb.GetMapResponse(header=_map_header(snapshot, map_uid))
    tiles_per_message = max(1, _TILE_MESSAGE_BYTES // snapshot.tile_cells**2)
    for first in range(0, len(snapshot.tile_origins), tiles_per_message):
        message = pb.MapTiles()
        for tile, (column, row) in enumerate(
            snapshot.tile_origins[first : first + tiles_per_message].tolist(), start=first
        ):
            cells = snapshot.occupancy(tile).tobytes()
            message.tiles.add(min_column=column, min_row=row, cells=cells)
        yield pb.GetMapResponse(tiles=message)


def _map_header(snapshot: MapSnapshot, map_uid: str) -> pb.MapHeader:
    header = pb.MapHeader(
        version=pb.MapVersion(map_uid=map_uid, revision=snapshot.revision, generation=snapshot.generation),
        stamp=timestamp(snapshot.stamp_ns),
        frame_id=_MAP_FRAME,
        resolution_meters=snapshot.resolution_m,
        tile_cells=snapshot.tile_cells,
        tile_count=len(snapshot.tile_origins),
        encoding=pb.CELL_ENCODING_OCCUPANCY_INT8,
    )
    if len(snapshot.tile_origins):
        low = snapshot.tile_origins.min(axis=0)
        size = snapshot.tile_origins.max(axis=0) - low + snapshot.tile_cells
        header.min_column, header.min_row = low.tolist()
        header.columns, header.rows = size.tolist()
    return header


def trajectory_messages(trajectory: Trajectory) -> Iterator[pb.GetTrajectoryResponse]:
    """All poses, in messages of at most 4096 of them."""
    for first in range(0, len(trajectory.stamps_ns), _POSES_PER_MESSAGE):
        part = slice(first, first + _POSES_PER_MESSAGE)
        message = pb.GetTrajectoryResponse()
        for stamp_ns, pose, processed in zip(
            trajectory.stamps_ns[part].tolist(),
            trajectory.map_from_base[part],
            trajectory.processed[part].tolist(),
            strict=True,
        ):
            message.poses.add(stamp=timestamp(stamp_ns), pose=pose_message(pose), processed=processed)
        yield message
