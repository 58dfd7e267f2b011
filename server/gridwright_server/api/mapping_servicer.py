"""gridwright.v1.MappingService: convert, call, convert."""

from collections.abc import Iterator
from concurrent.futures import Future

import grpc
from gridwright.v1 import mapping_service_pb2 as pb
from gridwright.v1.mapping_service_pb2_grpc import MappingServiceServicer

from gridwright_server.api.convert.checks import session_id_of
from gridwright_server.api.convert.results import (
    estimate_message,
    map_messages,
    trajectory_messages,
    verdict_value,
)
from gridwright_server.api.convert.sensor import odometry_request_item, scan_request_item, start_of
from gridwright_server.api.open_streams import OpenStreams
from gridwright_server.api.rejections import raise_if_rejected
from gridwright_server.api.sensor_stream import SensorStream
from gridwright_server.errors import FailedPreconditionError, GridwrightError
from gridwright_server.session.items import Outcome, SensorItem
from gridwright_server.session.registry import SessionRegistry
from gridwright_server.session.session import Session


class MappingServicer(MappingServiceServicer):
    """What a robot needs while it drives."""

    def __init__(self, registry: SessionRegistry, streams: OpenStreams) -> None:
        self._registry = registry
        self._streams = streams

    def AddLaserScan(  # noqa: N802
        self, request: pb.AddLaserScanRequest, context: grpc.ServicerContext
    ) -> pb.AddLaserScanResponse:
        """Answers when the scan has been processed."""
        session = self._session(request.session_id)
        outcome = _processed(session, scan_request_item(request, session.spec.base_from_laser))
        response = pb.AddLaserScanResponse(verdict=verdict_value(outcome.verdict))
        if outcome.estimate is not None:
            response.pose.CopyFrom(estimate_message(outcome.estimate))
        return response

    def AddOdometry(  # noqa: N802
        self, request: pb.AddOdometryRequest, context: grpc.ServicerContext
    ) -> pb.AddOdometryResponse:
        """Answers when the reading has been taken up."""
        outcome = _processed(self._session(request.session_id), odometry_request_item(request))
        return pb.AddOdometryResponse(verdict=verdict_value(outcome.verdict))

    def StreamSensorData(  # noqa: N802
        self, request_iterator: Iterator[pb.StreamSensorDataRequest], context: grpc.ServicerContext
    ) -> Iterator[pb.StreamSensorDataResponse]:
        """A verdict for every item, while more come in."""
        with self._streams.slot() as slot:
            start = start_of(next(request_iterator, None))
            stream = SensorStream(self._session(start.session_id), request_iterator, start.want_poses)
            slot.on_server_stop(stream.end)
            if not context.add_callback(stream.abandon):
                return  # the client is gone already
            yield from stream.responses()

    def GetPose(  # noqa: N802
        self, request: pb.GetPoseRequest, context: grpc.ServicerContext
    ) -> pb.GetPoseResponse:
        """The newest pose."""
        session = self._session(request.session_id)
        estimate = session.latest
        if estimate is None:
            raise _no_scan_yet(session)
        return pb.GetPoseResponse(pose=estimate_message(estimate))

    def GetMap(  # noqa: N802
        self, request: pb.GetMapRequest, context: grpc.ServicerContext
    ) -> Iterator[pb.GetMapResponse]:
        """The map at this moment; mapping goes on while it is sent."""
        session = self._session(request.session_id)
        snapshot = session.call(lambda mapper: mapper.map_snapshot())
        if snapshot is None:
            raise _no_scan_yet(session)
        try:
            yield from map_messages(snapshot, session.map_uid)
        finally:
            snapshot.close()

    def GetTrajectory(  # noqa: N802
        self, request: pb.GetTrajectoryRequest, context: grpc.ServicerContext
    ) -> Iterator[pb.GetTrajectoryResponse]:
        """The best particle's trajectory as known now."""
        session = self._session(request.session_id)
        yield from trajectory_messages(session.call(lambda mapper: mapper.trajectory()))

    def _session(self, session_id: str) -> Session:
        return self._registry.get(session_id_of(session_id))


def _processed(session: Session, item: SensorItem) -> Outcome:
    """Submits the item and waits for its outcome; raises where it was rejected."""
    future: Future[Outcome] = Future()

    def deliver(outcome: Outcome | GridwrightError) -> None:
        if isinstance(outcome, GridwrightError):
            future.set_exception(outcome)
        else:
            future.set_result(outcome)

    session.submit(item, deliver)
    outcome = future.result()
    raise_if_rejected(outcome.verdict)
    return outcome


def _no_scan_yet(session: Session) -> GridwrightError:
    return FailedPreconditionError(
        "NO_SCAN_YET", f"session {session.spec.session_id} has no scan yet: send odometry and a scan first"
    )
