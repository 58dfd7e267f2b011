"""Session messages to and from the session's own types; also what a session's journal keeps."""

import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import asdict

import numpy as np
from google.protobuf.message import DecodeError
from gridwright.v1 import mapping_service_pb2, sensor_pb2
from gridwright.v1 import session_service_pb2 as pb

from gridwright_server.api.convert.checks import Checks
from gridwright_server.api.convert.configuration import config_from_message, config_message
from gridwright_server.api.convert.results import pose_message, timestamp
from gridwright_server.api.convert.sensor import recorded_item
from gridwright_server.config import MapperConfig
from gridwright_server.errors import InvalidArgumentError
from gridwright_server.session.items import SensorItem, SessionSpec
from gridwright_server.session.session import Session
from gridwright_server.slam.types import Pose

_DEFAULT_LASER = "laser"
_DEFAULT_PAGE = 50
_LARGEST_PAGE = 1000


def spec_of(request: pb.CreateSessionRequest) -> SessionSpec:
    """What the request asks for, with defaults filled in; raises InvalidArgumentError."""
    checks = Checks()
    if request.session_id:
        checks.identifier("session_id", request.session_id)
    lasers = _mountings(request.lasers, checks)
    config = MapperConfig()
    try:
        config = config_from_message(request.config)
    except InvalidArgumentError as error:
        checks.violations.extend(error.violations)
    checks.raise_if_any()
    return SessionSpec(
        session_id=request.session_id or str(uuid.uuid4()),
        create_time_ns=time.time_ns(),
        config=config,
        seed=request.seed,
        base_from_laser=lasers,
    )


def page_of(request: pb.ListSessionsRequest) -> tuple[str, int]:
    """The id after which the page begins, and its size; raises InvalidArgumentError."""
    checks = Checks()
    if request.page_size < 0:
        checks.report("page_size", f"is {request.page_size}, must not be negative")
    if request.page_token:
        checks.identifier("page_token", request.page_token)
    checks.raise_if_any()
    return request.page_token, min(request.page_size or _DEFAULT_PAGE, _LARGEST_PAGE)


def session_message(session: Session) -> pb.Session:
    """The session as it stands."""
    message = _spec_message(session.spec)
    message.state = pb.SessionState.Value(f"SESSION_STATE_{session.state.name}")
    message.counts.CopyFrom(pb.SessionCounts(**asdict(session.counts)))
    return message


class RecordCodec:
    """Journals keep a session's own message and its SensorItem messages."""

    def encode_spec(self, spec: SessionSpec) -> bytes:
        """With the configuration in force, for another version may have other defaults."""
        return _spec_message(spec).SerializeToString()

    def decode_spec(self, payload: bytes) -> SessionSpec:
        """Raises ValueError or InvalidArgumentError for what this server does not accept."""
        message = pb.Session()
        _parse(message, payload)
        checks = Checks()
        lasers = _mountings(message.lasers, checks)
        checks.raise_if_any()
        return SessionSpec(
            session_id=message.session_id,
            create_time_ns=message.create_time.ToNanoseconds(),
            config=config_from_message(message.config),
            seed=message.seed,
            base_from_laser=lasers,
        )

    def decode_item(self, payload: bytes, spec: SessionSpec) -> SensorItem:
        """Raises ValueError or InvalidArgumentError for what this server does not accept."""
        message = mapping_service_pb2.SensorItem()
        _parse(message, payload)
        return recorded_item(message, spec.base_from_laser)


def _parse(message: pb.Session | mapping_service_pb2.SensorItem, payload: bytes) -> None:
    try:
        message.ParseFromString(payload)
    except DecodeError as error:
        raise ValueError("a record does not decode") from error


def _spec_message(spec: SessionSpec) -> pb.Session:
    return pb.Session(
        session_id=spec.session_id,
        create_time=timestamp(spec.create_time_ns),
        config=config_message(spec.config),
        seed=spec.seed,
        lasers=[
            sensor_pb2.LaserMounting(sensor_id=sensor_id, pose=pose_message(pose))
            for sensor_id, pose in spec.base_from_laser.items()
        ],
    )


def _mountings(lasers: Sequence[sensor_pb2.LaserMounting], checks: Checks) -> Mapping[str, Pose]:
    mountings: dict[str, Pose] = {}
    for index, laser in enumerate(lasers):
        checks.identifier(f"lasers[{index}].sensor_id", laser.sensor_id)
        if laser.sensor_id in mountings:
            checks.report(f"lasers[{index}].sensor_id", "is the id of another laser too")
        mountings[laser.sensor_id] = checks.pose(laser.pose, f"lasers[{index}].pose.")
    return mountings or {_DEFAULT_LASER: np.zeros(3)}
