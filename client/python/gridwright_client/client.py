"""A typed, synchronous client of a mapping server."""

import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from types import TracebackType
from typing import Any, Self

import grpc
import numpy as np
from gridwright.v1 import mapping_service_pb2 as mapping
from gridwright.v1 import session_service_pb2 as sessions
from gridwright.v1.mapping_service_pb2_grpc import MappingServiceStub
from gridwright.v1.sensor_pb2 import LaserMounting, Verdict
from gridwright.v1.session_service_pb2_grpc import SessionServiceStub
from grpc_health.v1.health_pb2 import HealthCheckRequest, HealthCheckResponse
from grpc_health.v1.health_pb2_grpc import HealthStub
from numpy.typing import NDArray

from gridwright_client import items as builders
from gridwright_client.errors import GridwrightRpcError
from gridwright_client.results import OccupancyMap, Trajectory, assemble_map, assemble_trajectory
from gridwright_client.stream import SensorStream

_CHANNEL_OPTIONS = [
    ("grpc.keepalive_time_ms", 30_000),  # a server that vanished is noticed on idle streams too
    ("grpc.keepalive_timeout_ms", 20_000),
]
_HEALTH_POLL_S = 0.05


class MappingClient:
    """One connection to a server; usable from several threads.

    Every call but `stream` has a deadline: `timeout_s`, or, where the server may have much to do
    (finish, map, trajectory), `long_timeout_s`. All raise GridwrightRpcError.
    """

    def __init__(self, address: str, *, timeout_s: float = 30.0, long_timeout_s: float = 600.0) -> None:
        self._timeout_s = timeout_s
        self._long_timeout_s = long_timeout_s
        self._channel = grpc.insecure_channel(address, options=_CHANNEL_OPTIONS)
        self._health: Any = HealthStub(self._channel)  # its type stub lacks the methods
        self._sessions = SessionServiceStub(self._channel)
        self._mapping = MappingServiceStub(self._channel)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        exc_type: type[BaseException] | None,
        exc: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Ends the connection and every call on it."""
        self._channel.close()

    def wait_until_serving(self, timeout_s: float = 300.0) -> None:
        """Returns once the server is reachable and has compiled its kernels.

        A server's first start takes minutes where nothing is cached yet.
        """
        deadline_s = time.monotonic() + timeout_s
        while True:
            remaining_s = deadline_s - time.monotonic()
            with _wrapped_errors():
                answer = self._health.Check(
                    HealthCheckRequest(), timeout=max(remaining_s, 0.0), wait_for_ready=True
                )
            if answer.status == HealthCheckResponse.SERVING:
                return
            time.sleep(_HEALTH_POLL_S)

    def create_session(
        self,
        session_id: str = "",
        *,
        config: sessions.MapperConfig | None = None,
        seed: int = 0,
        lasers: Sequence[LaserMounting] = (),
    ) -> sessions.Session:
        """Starts a map; what is unset in `config` takes the server's default."""
        request = sessions.CreateSessionRequest(
            session_id=session_id, config=config, seed=seed, lasers=lasers
        )
        with _wrapped_errors():
            return self._sessions.CreateSession(request, timeout=self._timeout_s).session

    def get_session(self, session_id: str) -> sessions.Session:
        """The session's state, effective configuration and counts."""
        request = sessions.GetSessionRequest(session_id=session_id)
        with _wrapped_errors():
            return self._sessions.GetSession(request, timeout=self._timeout_s).session

    def list_sessions(self) -> Iterator[sessions.Session]:
        """Every session, by id."""
        request = sessions.ListSessionsRequest()
        while True:
            with _wrapped_errors():
                page = self._sessions.ListSessions(request, timeout=self._timeout_s)
            yield from page.sessions
            if not page.next_page_token:
                return
            request = sessions.ListSessionsRequest(page_token=page.next_page_token)

    def finish_session(self, session_id: str) -> sessions.Session:
        """Waits until all that is queued has been processed; the session then takes no more data."""
        request = sessions.FinishSessionRequest(session_id=session_id)
        with _wrapped_errors():
            return self._sessions.FinishSession(request, timeout=self._long_timeout_s).session

    def delete_session(self, session_id: str) -> None:
        """Drops the session, its map and what the server has stored of it."""
        request = sessions.DeleteSessionRequest(session_id=session_id)
        with _wrapped_errors():
            self._sessions.DeleteSession(request, timeout=self._timeout_s)

    def add_scan(
        self,
        session_id: str,
        stamp_ns: int,
        ranges_m: NDArray[np.floating],
        *,
        angle_min_rad: float,
        angle_increment_rad: float,
        range_min_m: float,
        range_max_m: float,
        sensor_id: str = "",
    ) -> mapping.AddLaserScanResponse:
        """Sends one scan and waits until it has been processed; `ranges_m` has shape (beams,)."""
        scan = builders.laser_scan(
            stamp_ns,
            ranges_m,
            angle_min_rad=angle_min_rad,
            angle_increment_rad=angle_increment_rad,
            range_min_m=range_min_m,
            range_max_m=range_max_m,
            sensor_id=sensor_id,
        )
        request = mapping.AddLaserScanRequest(session_id=session_id, scan=scan)
        with _wrapped_errors():
            return self._mapping.AddLaserScan(request, timeout=self._timeout_s)

    def add_odometry(
        self, session_id: str, stamp_ns: int, x_m: float, y_m: float, theta_rad: float
    ) -> Verdict.ValueType:
        """Sends one odometry reading: base_link in the frame odom."""
        reading = builders.odometry(stamp_ns, x_m, y_m, theta_rad)
        request = mapping.AddOdometryRequest(session_id=session_id, odometry=reading)
        with _wrapped_errors():
            return self._mapping.AddOdometry(request, timeout=self._timeout_s).verdict

    def stream(
        self,
        session_id: str,
        items: Iterable[mapping.SensorItem],
        *,
        want_poses: bool = False,
        batch_size: int = 64,
    ) -> Iterator[mapping.ItemVerdict]:
        """Sends items while verdicts come back, one per item, in order.

        `items` is drawn from another thread. It is sent in batches, so an item may wait for those
        after it: use a `batch_size` of 1 for data that comes live. There is no deadline: a stream
        may last for as long as the robot drives; a vanished server is noticed by keepalive.
        """
        stream = SensorStream(self._mapping, session_id, items, want_poses, batch_size)
        with stream, _wrapped_errors():
            yield from stream.verdicts()

    def next_sequence_number(self, session_id: str) -> int:
        """The sequence number that the session expects next."""
        stream = SensorStream(self._mapping, session_id, (), want_poses=False, batch_size=1)
        with stream, _wrapped_errors():
            return stream.next_sequence_number()

    def pose(self, session_id: str) -> mapping.PoseEstimate:
        """The newest pose."""
        request = mapping.GetPoseRequest(session_id=session_id)
        with _wrapped_errors():
            return self._mapping.GetPose(request, timeout=self._timeout_s).pose

    def map(self, session_id: str) -> OccupancyMap:
        """The best particle's map as known now."""
        request = mapping.GetMapRequest(session_id=session_id)
        with _wrapped_errors():
            return assemble_map(self._mapping.GetMap(request, timeout=self._long_timeout_s))

    def trajectory(self, session_id: str) -> Trajectory:
        """The best particle's trajectory as known now."""
        request = mapping.GetTrajectoryRequest(session_id=session_id)
        with _wrapped_errors():
            return assemble_trajectory(self._mapping.GetTrajectory(request, timeout=self._long_timeout_s))


@contextmanager
def _wrapped_errors() -> Iterator[None]:
    try:
        yield
    except grpc.RpcError as error:
        raise GridwrightRpcError(error) from error
