"""One log through one session of a server."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from gridwright.v1.geometry_pb2 import Pose2D
from gridwright.v1.mapping_service_pb2 import ItemVerdict, PoseEstimate
from gridwright.v1.sensor_pb2 import LaserMounting, Verdict
from gridwright.v1.session_service_pb2 import MapperConfig, Session
from numpy.typing import NDArray

from gridwright_client.client import MappingClient
from gridwright_client.replay.events import Event, ScanEvent, sensor_items
from gridwright_client.replay.window import SendingWindow
from gridwright_client.results import OccupancyMap
from gridwright_client.se2 import Poses, between, compose
from gridwright_client.trajectory_file import TimedPoses

_BATCH_SIZE = 64


@dataclass(frozen=True)
class ReplayOptions:
    """How to replay."""

    config: MapperConfig
    seed: int = 0
    times_real_time: float | None = None
    """None = as fast as the server takes it."""


@dataclass
class Tally:
    """What the server has answered so far."""

    scans: Counter[str] = field(default_factory=Counter)
    """By verdict."""
    odometry: Counter[str] = field(default_factory=Counter)
    """By verdict."""
    newest: PoseEstimate | None = None
    online: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    """By the scan's place among the scans: map_from_base as it was known at the scan."""
    items: int = 0

    @property
    def scan_count(self) -> int:
        """How many scans have been answered."""
        return self.scans.total()


@dataclass(frozen=True)
class Mapped:
    """What came of a replay; the trajectories have a pose for each scan that was answered."""

    session: Session
    tally: Tally
    wall_s: float
    """From the first item sent to the last one processed."""
    grid: OccupancyMap
    final: TimedPoses
    online: TimedPoses
    odometry: TimedPoses


def replay_events(
    client: MappingClient,
    events: Sequence[Event],
    base_from_laser: Mapping[str, Poses],
    options: ReplayOptions,
    *,
    stop: threading.Event,
    on_progress: Callable[[Tally], None],
) -> Mapped:
    """Maps the events in a new session, which stays on the server, finished.

    Once `stop` is set no more is sent, and what was sent is mapped. Raises GridwrightRpcError.
    """
    lasers = [
        LaserMounting(sensor_id=sensor_id, pose=_pose2d(pose)) for sensor_id, pose in base_from_laser.items()
    ]
    session_id = client.create_session(config=options.config, seed=options.seed, lasers=lasers).session_id
    started_s = time.perf_counter()
    tally = _stream(client, session_id, events, options, SendingWindow(stop), on_progress)
    session = client.finish_session(session_id)
    wall_s = time.perf_counter() - started_s
    scans = [event for event in events[: tally.items] if isinstance(event, ScanEvent)]
    accepted = np.array(sorted(tally.online), dtype=np.intp)
    trajectory = client.trajectory(session_id)
    return Mapped(
        session=session,
        tally=tally,
        wall_s=wall_s,
        grid=client.map(session_id),
        final=_completed(scans, accepted, trajectory.poses),
        online=_completed(scans, accepted, np.array([tally.online[index] for index in accepted.tolist()])),
        odometry=TimedPoses(_stamps_ns(scans), _odometry(scans)),
    )


def _stream(
    client: MappingClient,
    session_id: str,
    events: Sequence[Event],
    options: ReplayOptions,
    window: SendingWindow,
    on_progress: Callable[[Tally], None],
) -> Tally:
    tally = Tally()
    verdicts = client.stream(
        session_id,
        sensor_items(events, window, options.times_real_time),
        want_poses=True,
        batch_size=_BATCH_SIZE if options.times_real_time is None else 1,
    )
    try:
        for verdict in verdicts:
            window.answered()
            _count(verdict, isinstance(events[verdict.sequence_number - 1], ScanEvent), tally)
            on_progress(tally)
    finally:
        window.close()
    return tally


def _count(answer: ItemVerdict, is_scan: bool, tally: Tally) -> None:
    name = Verdict.Name(answer.verdict).removeprefix("VERDICT_")
    tally.items += 1
    if not is_scan:
        tally.odometry[name] += 1
        return
    if answer.HasField("pose"):
        tally.newest = answer.pose
        pose = answer.pose.pose
        tally.online[tally.scan_count] = (pose.x_meters, pose.y_meters, pose.theta_radians)
    tally.scans[name] += 1


def _completed(scans: Sequence[ScanEvent], accepted: NDArray[np.intp], poses: Poses) -> TimedPoses:
    """A pose for every scan; a rejected one's is moved by odometry from the nearest accepted one before.

    Before the first accepted scan, it is moved back from that one. `poses`, shape (accepted, 3), are
    those of the scans at the places `accepted`.
    """
    if len(accepted) == 0:
        return TimedPoses(np.zeros(0, dtype=np.int64), np.zeros((0, 3)))
    anchors = np.maximum(np.searchsorted(accepted, np.arange(len(scans)), side="right") - 1, 0)
    odometry = _odometry(scans)
    moved = compose(poses[anchors], between(odometry[accepted[anchors]], odometry))
    moved[accepted] = poses
    return TimedPoses(_stamps_ns(scans), moved)


def _odometry(scans: Sequence[ScanEvent]) -> Poses:
    return np.array([scan.odom_from_base for scan in scans], dtype=np.float64).reshape(-1, 3)


def _stamps_ns(scans: Sequence[ScanEvent]) -> NDArray[np.int64]:
    return np.array([scan.stamp_ns for scan in scans], dtype=np.int64)


def _pose2d(pose: Poses) -> Pose2D:
    x, y, theta = pose.tolist()
    return Pose2D(x_meters=x, y_meters=y, theta_radians=theta)
