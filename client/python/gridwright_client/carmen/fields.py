"""Reading a line's fields: numbers, poses and exact times."""

import math
from collections.abc import Iterable
from decimal import Decimal, InvalidOperation

import numpy as np

from gridwright_client.se2 import Poses

_NANOSECONDS = 1_000_000_000
_LAST_STAMP_NS = 253_402_300_800 * _NANOSECONDS  # the year 10000, where protobuf's Timestamp ends
_TRAILER_FIELDS = 3  # ipc_timestamp ipc_hostname logger_timestamp


class MalformedLineError(ValueError):
    """A line that breaks its message's format; the text is the reason."""


def number(field: bytes) -> float:
    """A decimal number, possibly Inf or NaN."""
    try:
        if b"_" in field:  # Python's own notation, not a log's
            raise ValueError
        return float(field)
    except ValueError:
        raise MalformedLineError(f"{_shown(field)} is not a number") from None


def numbers(fields: Iterable[bytes]) -> list[float]:
    """Decimal numbers, possibly Inf or NaN."""
    fields = list(fields)
    try:
        values = list(map(float, fields))
    except ValueError:
        return [number(field) for field in fields]  # to name the one that is wrong
    if b"_" in b"".join(fields):
        return [number(field) for field in fields]
    return values


def finite(field: bytes, what: str) -> float:
    """A finite number."""
    value = number(field)
    if not math.isfinite(value):
        raise MalformedLineError(f"{what} is {_shown(field)}, not finite")
    return value


def pose(fields: list[bytes], what: str) -> Poses:
    """x, y in metres and theta in radians, shape (3,); theta within [-pi, pi)."""
    values = numbers(fields)
    if not all(map(math.isfinite, values)):
        raise MalformedLineError(f"the {what} pose is not finite")
    x, y, theta = values
    # By plain floats: a log has tens of thousands of poses, and most need no wrapping.
    wrapped = theta if -math.pi <= theta < math.pi else (theta + math.pi) % (2 * math.pi) - math.pi
    return np.array((x, y, wrapped))


def count(field: bytes, what: str) -> int:
    """A number of things, 0 or more."""
    if not field.isdigit():
        raise MalformedLineError(f"the number of {what} is {_shown(field)}")
    return int(field)


def expect_length(fields: list[bytes], length: int) -> None:
    """Refuses a message that has not exactly this many fields, its name included."""
    if len(fields) < length:
        raise MalformedLineError(f"too few fields: {len(fields)}, not {length}")
    if len(fields) > length:
        raise MalformedLineError(f"too many fields: {len(fields)}, not {length}")


def stamp(fields: list[bytes]) -> int:
    """The time of the message's origin, the third last field, in integer nanoseconds.

    Taken from the decimal text: a float64 of seconds since 1970 is off by up to 120 ns.
    """
    text = fields[-_TRAILER_FIELDS]
    seconds, _, fraction = text.partition(b".")
    if seconds.isdigit() and (fraction.isdigit() or not fraction) and len(fraction) <= 9:
        stamp_ns = int(seconds) * _NANOSECONDS + int(fraction.ljust(9, b"0"))
    else:
        stamp_ns = _unusual_stamp(text)
    if not 0 <= stamp_ns < _LAST_STAMP_NS:
        raise MalformedLineError(f"the time {_shown(text)} is not between the years 1970 and 9999")
    return stamp_ns


def _unusual_stamp(text: bytes) -> int:
    """Exponents, signs and more digits than nanoseconds have."""
    try:
        seconds = Decimal(text.decode("ascii"))
    except (InvalidOperation, UnicodeDecodeError):
        raise MalformedLineError(f"the time {_shown(text)} is not a number") from None
    if not seconds.is_finite() or abs(seconds.adjusted()) > 20:
        raise MalformedLineError(f"the time {_shown(text)} is out of range")
    return round(seconds * _NANOSECONDS)


def _shown(field: bytes) -> str:
    return repr(field[:20].decode("utf-8", errors="replace"))
