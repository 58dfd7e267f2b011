"""Trajectories as text: TUM lines, and the plain odometry lines that come with recorded logs."""

from dataclasses import dataclass
from decimal import Decimal, InvalidOperation
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridwright_client.se2 import Poses, wrap

_NANOSECONDS = 1_000_000_000
_LARGEST_NS = 1 << 62  # so that differences of two times stay within int64
_TUM_FIELDS = 8  # timestamp x y z qx qy qz qw
_PLAIN_FIELDS = 4  # timestamp x y theta


class FileFormatError(ValueError):
    """A file that is not what it should be; names the file and the line."""


@dataclass(frozen=True)
class TimedPoses:
    """Poses and their times, in the order of the file."""

    stamps_ns: NDArray[np.int64]
    """shape (n,); not necessarily increasing"""
    poses: Poses
    """shape (n, 3)"""

    def __len__(self) -> int:
        return len(self.stamps_ns)


def stamp_text(stamp_ns: int) -> str:
    """Seconds with six decimals, or with nine where six would round."""
    seconds, nanos = divmod(stamp_ns, _NANOSECONDS)
    return f"{seconds}.{nanos // 1000:06d}" if nanos % 1000 == 0 else f"{seconds}.{nanos:09d}"


def parse_stamp_ns(text: str) -> int:
    """Integer nanoseconds of decimal seconds, exactly; raises ValueError."""
    try:
        stamp_ns = round(Decimal(text) * _NANOSECONDS)
    except (InvalidOperation, OverflowError, ValueError):
        raise ValueError(f"{text!r} is not a time") from None
    if abs(stamp_ns) > _LARGEST_NS:
        raise ValueError(f"the time {text} is out of range")
    return stamp_ns


def write_tum(path: Path, trajectory: TimedPoses) -> None:
    """Writes `timestamp x y z qx qy qz qw` lines (seconds, metres, unit quaternion)."""
    halves = trajectory.poses[:, 2] / 2.0
    rows = zip(
        trajectory.stamps_ns.tolist(),
        trajectory.poses[:, :2].tolist(),
        np.sin(halves).tolist(),
        np.cos(halves).tolist(),
        strict=True,
    )
    lines = [
        f"{stamp_text(stamp_ns)} {x:.6f} {y:.6f} 0 0 0 {qz:.9f} {qw:.9f}\n"
        for stamp_ns, (x, y), qz, qw in rows
    ]
    path.write_text("".join(lines), encoding="ascii")


def read_trajectory(path: Path) -> TimedPoses:
    """Reads TUM lines or `timestamp x y theta` lines; `#` begins a comment.

    Raises OSError where the file cannot be read, FileFormatError where it is something else.
    """
    rows = read_rows(path, (_TUM_FIELDS, _PLAIN_FIELDS), 1, "`timestamp x y z qx qy qz qw`")
    stamps_ns = np.array([row.stamps_ns[0] for row in rows], dtype=np.int64)
    return TimedPoses(stamps_ns, np.array([_pose(row.values) for row in rows]))


@dataclass(frozen=True)
class Row:
    """One line: times first, then other numbers."""

    stamps_ns: list[int]
    values: list[float]


def read_rows(path: Path, lengths: tuple[int, ...], times: int, form: str) -> list[Row]:
    """Lines of finite numbers whose first `times` are seconds; at least one line.

    `lengths` are the permitted numbers of fields, `form` describes them in error messages.
    """
    rows = []
    text = path.read_bytes().decode("utf-8", errors="replace")
    for line_number, line in enumerate(text.splitlines(), start=1):
        fields = line.split("#", 1)[0].split()
        if not fields:
            continue
        try:
            if len(fields) not in lengths:
                raise ValueError(f"has {len(fields)} numbers")
            values = [float(field) for field in fields[times:]]
            if not np.isfinite(values).all():
                raise ValueError("has a number that is not finite")
            rows.append(Row([parse_stamp_ns(field) for field in fields[:times]], values))
        except ValueError as error:
            raise FileFormatError(f"{path}, line {line_number}: {error}; expected {form}") from None
    if not rows:
        raise FileFormatError(f"{path} holds no lines of the form {form}")
    return rows


def _pose(values: list[float]) -> tuple[float, float, float]:
    if len(values) == _PLAIN_FIELDS - 1:
        x, y, theta = values
        return x, y, float(wrap(theta))
    x, y, _, qx, qy, qz, qw = values
    yaw = np.arctan2(2.0 * (qw * qz + qx * qy), 1.0 - 2.0 * (qy * qy + qz * qz))
    return x, y, float(yaw)
