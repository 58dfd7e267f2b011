"""The rules that several messages share; each check reports what it finds and goes on."""

import math
import re

import numpy as np
from google.protobuf.message import Message
from google.protobuf.timestamp_pb2 import Timestamp
from gridwright.v1.geometry_pb2 import Pose2D

from gridwright_server.errors import FieldViolation, InvalidArgumentError
from gridwright_server.slam.types import Pose

ID_RULE = "must consist of 1 to 63 of the characters a-z, 0-9 and -"
_ID = re.compile(r"[a-z0-9-]{1,63}")
_NANOSECONDS = 1_000_000_000
_LARGEST_STAMP_NS = 2**62  # the difference of any two stamps then fits 64 bits
_LARGEST_COORDINATE_M = 1e6


class Checks:
    """Gathers the violations of one message."""

    def __init__(self) -> None:
        self.violations: list[FieldViolation] = []

    def report(self, field: str, description: str) -> None:
        """Notes one broken rule."""
        self.violations.append(FieldViolation(field, description))

    def within(self, field: str, value: float, low: float, high: float) -> None:
        """A finite number in [low, high]."""
        if not low <= value <= high:  # also true of NaN
            self.report(field, f"is {value:g}, must lie in [{low:g}, {high:g}]")

    def identifier(self, field: str, value: str) -> None:
        """A session or sensor id."""
        if not _ID.fullmatch(value):
            self.report(field, ID_RULE)

    def present(self, message: Message, path: str, field: str) -> bool:
        """Whether the submessage is set."""
        if message.HasField(field):
            return True
        self.report(f"{path}{field}", "must be set")
        return False

    def stamp_ns(self, message: Message, path: str) -> int:
        """The message's field `stamp` in nanoseconds since 1970."""
        if not self.present(message, path, "stamp"):
            return 0
        stamp: Timestamp = message.stamp  # type: ignore[attr-defined]
        stamp_ns = stamp.seconds * _NANOSECONDS + stamp.nanos
        if not 0 <= stamp.nanos < _NANOSECONDS:
            self.report(f"{path}stamp.nanos", f"is {stamp.nanos}, must lie in [0, 999999999]")
        elif abs(stamp_ns) > _LARGEST_STAMP_NS:
            self.report(f"{path}stamp.seconds", f"is {stamp.seconds}, must lie in the years 1824 to 2116")
        return stamp_ns

    def pose(self, pose: Pose2D, path: str) -> Pose:
        """A pose not farther than 1000 km from its origin; its angle is brought into [-pi, pi]."""
        self.within(f"{path}x_meters", pose.x_meters, -_LARGEST_COORDINATE_M, _LARGEST_COORDINATE_M)
        self.within(f"{path}y_meters", pose.y_meters, -_LARGEST_COORDINATE_M, _LARGEST_COORDINATE_M)
        if not math.isfinite(pose.theta_radians):
            self.report(f"{path}theta_radians", f"is {pose.theta_radians:g}, must be finite")
            return np.zeros(3)
        return np.array([pose.x_meters, pose.y_meters, math.remainder(pose.theta_radians, math.tau)])

    def raise_if_any(self) -> None:
        """Raises InvalidArgumentError naming every violation."""
        if self.violations:
            raise InvalidArgumentError(self.violations)


def session_id_of(session_id: str) -> str:
    """Checks the id by which a request names a session."""
    checks = Checks()
    checks.identifier("session_id", session_id)
    checks.raise_if_any()
    return session_id
