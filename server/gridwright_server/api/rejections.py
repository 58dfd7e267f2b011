"""What a rejected item is answered with where it came alone: a status. In a stream its verdict tells."""

from gridwright_server.errors import (
    FailedPreconditionError,
    GridwrightError,
    OutOfRangeError,
    ResourceExhaustedError,
)
from gridwright_server.slam.types import Verdict

_REJECTIONS: dict[Verdict, tuple[type[GridwrightError], str, str]] = {
    Verdict.REJECTED_OUT_OF_ORDER: (
        OutOfRangeError,
        "OUT_OF_ORDER",
        "the time stamp lies more than 2 s behind the newest one: send items in the order of events",
    ),
    Verdict.REJECTED_NO_ODOMETRY: (
        FailedPreconditionError,
        "NO_ODOMETRY",
        "the session has no odometry yet: send AddOdometry before the first scan",
    ),
    Verdict.REJECTED_OUTSIDE_MAP: (
        ResourceExhaustedError,
        "MAP_TOO_LARGE",
        "the scan would reach beyond the largest map a session may hold: look for a jump in the odometry",
    ),
}


def raise_if_rejected(verdict: Verdict) -> None:
    """Raises the error that a verdict stands for; others pass."""
    if verdict in _REJECTIONS:
        error, reason, message = _REJECTIONS[verdict]
        raise error(reason, message)
