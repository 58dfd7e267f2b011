"""The messages of a log, line by line, before the log's parameters are known.

The formats, after the message's name; each sensor message ends in the trailer
`ipc_timestamp ipc_hostname logger_timestamp`:

    PARAM name value
    ODOM x y theta tv rv accel
    TRUEPOS true_x true_y true_theta odom_x odom_y odom_theta
    FLASER, RLASER n range*n x y theta odom_x odom_y odom_theta
    RAWLASER1 type start_angle fov resolution max_range accuracy remission_mode
        n range*n m remission*m
    ROBOTLASER1, ROBOTLASER2 as RAWLASER1, then laser_x laser_y laser_theta x y theta
        tv rv forward_safety side_safety turn_axis
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from gridwright_client.carmen.fields import (
    MalformedLineError,
    count,
    expect_length,
    finite,
    number,
    numbers,
    pose,
    stamp,
)
from gridwright_client.carmen.readings import FRONT, REAR, OdometryReading, TruePoseReading
from gridwright_client.se2 import Poses, between

_TRAILER = 3
_POSES = 6  # two poses
_RAW_HEAD = 8  # the message's name, then what RAWLASER1 tells before its number of ranges
_ROBOT_TAIL = 11  # two poses, two velocities, two safety distances, the turn axis


@dataclass(frozen=True)
class DeclaredBeams:
    """What RAWLASER and ROBOTLASER messages tell of their laser."""

    start_angle_rad: float
    field_of_view_rad: float
    resolution_rad: float
    maximum_range_m: float
    """0 where the message names none."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """A laser message as it stands in the log."""

    line_number: int
    message: str
    stamp_ns: int
    sensor_id: str
    ranges_m: NDArray[np.float32]
    """shape (beams,)"""
    declared: DeclaredBeams | None
    odom_from_base: Poses | None
    base_from_laser: Poses | None
    """Between the two poses that the message carries; None where it carries none."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A setting of the robot's programs."""

    name: str
    value: str


Message = Sweep | OdometryReading | TruePoseReading | Parameter


def _parameter(_: int, fields: list[bytes]) -> Parameter:
    if len(fields) < 2:
        raise MalformedLineError(f"too few fields: {len(fields)}, not 3")
    # A value may be missing (an empty text) or of several words; the trailer is often incomplete.
    words = [field.decode("utf-8") for field in fields]
    return Parameter(words[1], words[2] if len(words) > 2 else "")


def _odometry(line_number: int, fields: list[bytes]) -> OdometryReading:
    expect_length(fields, 1 + _POSES + _TRAILER)
    numbers(fields[4:7])
    return OdometryReading(line_number, stamp(fields), pose(fields[1:4], "odometry"))


def _true_pose(line_number: int, fields: list[bytes]) -> TruePoseReading:
    expect_length(fields, 1 + _POSES + _TRAILER)
    numbers(fields[4:7])
    return TruePoseReading(line_number, stamp(fields), pose(fields[1:4], "true"))


def _plain_sweep(line_number: int, fields: list[bytes]) -> Sweep:
    sensor_id = FRONT if fields[0] == b"FLASER" else REAR
    ranges_m, end = _counted(fields, 1, "ranges", _POSES + _TRAILER)
    expect_length(fields, end + _POSES + _TRAILER)
    laser = pose(fields[end : end + 3], "laser")
    base = pose(fields[end + 3 : end + 6], "odometry")
    mounting = between(base, laser)
    message = fields[0].decode("ascii")
    return Sweep(line_number, message, stamp(fields), sensor_id, ranges_m, None, base, mounting)


def _raw_sweep(line_number: int, fields: list[bytes]) -> Sweep:
    ranges_m, end = _raw_ranges(fields, _TRAILER)
    expect_length(fields, end + _TRAILER)
    return Sweep(line_number, "RAWLASER1", stamp(fields), FRONT, ranges_m, _declared(fields), None, None)


def _robot_sweep(line_number: int, fields: list[bytes]) -> Sweep:
    sensor_id = FRONT if fields[0] == b"ROBOTLASER1" else REAR
    ranges_m, end = _raw_ranges(fields, _ROBOT_TAIL + _TRAILER)
    expect_length(fields, end + _ROBOT_TAIL + _TRAILER)
    laser = pose(fields[end : end + 3], "laser")
    base = pose(fields[end + 3 : end + 6], "robot")
    numbers(fields[end + 6 : end + _ROBOT_TAIL])
    declared, mounting = _declared(fields), between(base, laser)
    message = fields[0].decode("ascii")
    return Sweep(line_number, message, stamp(fields), sensor_id, ranges_m, declared, base, mounting)


def _raw_ranges(fields: list[bytes], tail: int) -> tuple[NDArray[np.float32], int]:
    """The ranges, and where the fields after the remissions begin."""
    ranges_m, end = _counted(fields, _RAW_HEAD, "ranges", 1 + tail)
    _, end = _counted(fields, end, "remissions", tail)
    return ranges_m, end


def _declared(fields: list[bytes]) -> DeclaredBeams:
    names = ("start angle", "field of view", "resolution")
    start, view, resolution = (finite(fields[2 + index], name) for index, name in enumerate(names))
    maximum_m = number(fields[5])
    return DeclaredBeams(start, view, resolution, maximum_m if math.isfinite(maximum_m) else 0.0)


def _counted(fields: list[bytes], at: int, what: str, tail: int) -> tuple[NDArray[np.float32], int]:
    """As many numbers as the field `at` says, and where the fields after them begin."""
    if len(fields) <= at + tail:
        raise MalformedLineError(f"too few fields: {len(fields)}")
    end = at + 1 + count(fields[at], what)
    if end + tail > len(fields):
        raise MalformedLineError(
            f"{end - at - 1} {what} announced, but the line has only {len(fields)} fields"
        )
    return np.array(numbers(fields[at + 1 : end]), dtype=np.float32), end


PARSERS: dict[bytes, Callable[[int, list[bytes]], Message]] = {
    b"PARAM": _parameter,
    b"ODOM": _odometry,
    b"TRUEPOS": _true_pose,
    b"FLASER": _plain_sweep,
    b"RLASER": _plain_sweep,
    b"RAWLASER1": _raw_sweep,
    b"ROBOTLASER1": _robot_sweep,
    b"ROBOTLASER2": _robot_sweep,
}
"""By message name; each raises MalformedLineError."""
