"""What a log's readings become on the way to the server."""

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from gridwright.v1.mapping_service_pb2 import SensorItem
from gridwright.v1.sensor_pb2 import LaserScan, Odometry
from numpy.typing import NDArray

from gridwright_client import items
from gridwright_client.carmen import CarmenLog, LaserReading, OdometryReading
from gridwright_client.replay.window import SendingWindow
from gridwright_client.se2 import Poses, interpolate


@dataclass(frozen=True, slots=True)
class OdometryEvent:
    """One reading of dead reckoning."""

    stamp_ns: int
    odom_from_base: Poses


@dataclass(frozen=True, slots=True)
class ScanEvent:
    """One sweep, and where odometry has the robot at its time."""

    stamp_ns: int
    odom_from_base: Poses
    reading: LaserReading


Event = OdometryEvent | ScanEvent


class NoOdometryError(ValueError):
    """No reading of the log says where the robot believed to be."""


def events_of(log: CarmenLog) -> list[Event]:
    """The log's sweeps and odometry readings in the order of the file.

    Each sweep comes after an odometry reading with the sweep's own time: the one that its message
    carries, or one interpolated between the readings around it. So the server has nothing to guess.
    """
    odometry = _Odometry(log)
    posed_sweeps = {_identity(scan) for scan in log.scans if scan.odom_from_base is not None}
    events: list[Event] = []
    for reading in log.readings:
        if isinstance(reading, OdometryReading):
            events.append(OdometryEvent(reading.stamp_ns, reading.odom_from_base))
        elif isinstance(reading, LaserReading):
            pose = reading.odom_from_base
            if pose is None:
                if _identity(reading) in posed_sweeps:
                    continue  # logged twice: by the laser's driver, and by the robot with its pose
                pose = odometry.at(reading.stamp_ns)
            events.append(OdometryEvent(reading.stamp_ns, pose))
            events.append(ScanEvent(reading.stamp_ns, pose, reading))
    return events


def _identity(scan: LaserReading) -> tuple[int, str, bytes]:
    return scan.stamp_ns, scan.sensor_id, scan.ranges_m.tobytes()


class _Odometry:
    """All odometry of a log, by time."""

    def __init__(self, log: CarmenLog) -> None:
        stamped = [
            (reading.stamp_ns, reading.odom_from_base)
            for reading in log.readings
            if isinstance(reading, OdometryReading | LaserReading) and reading.odom_from_base is not None
        ]
        if not stamped:
            raise NoOdometryError
        stamped.sort(key=lambda entry: entry[0])
        self._stamps_ns: NDArray[np.int64] = np.array([stamp_ns for stamp_ns, _ in stamped], dtype=np.int64)
        self._poses = [pose for _, pose in stamped]

    def at(self, stamp_ns: int) -> Poses:
        """On the arc between the readings around a time; before the first and after the last, those."""
        after = int(np.searchsorted(self._stamps_ns, stamp_ns))
        if after == 0 or after == len(self._poses):
            return self._poses[min(after, len(self._poses) - 1)]
        before_ns, after_ns = int(self._stamps_ns[after - 1]), int(self._stamps_ns[after])
        fraction = (stamp_ns - before_ns) / (after_ns - before_ns)
        return interpolate(self._poses[after - 1], self._poses[after], fraction)


def robot_seconds(events: Sequence[Event]) -> float:
    """From the earliest to the latest time of the log."""
    stamps_ns = [event.stamp_ns for event in events]
    return (max(stamps_ns) - min(stamps_ns)) * 1e-9


def sensor_items(
    events: Sequence[Event], window: SendingWindow, times_real_time: float | None
) -> Iterator[SensorItem]:
    """The events as messages, as far as the window lets them.

    `times_real_time` paces by the events' stamps; None = as fast as they are answered.
    """
    started_s = time.monotonic()
    first_ns = events[0].stamp_ns if events else 0
    for sequence_number, event in enumerate(events, start=1):
        if times_real_time is not None:
            due_s = started_s + (event.stamp_ns - first_ns) * 1e-9 / times_real_time
            while window.is_open and (remaining_s := due_s - time.monotonic()) > 0.0:
                window.sleep(remaining_s)
        if not window.take():
            return
        yield items.sensor_item(sequence_number, _message(event))


def _message(event: Event) -> LaserScan | Odometry:
    if isinstance(event, OdometryEvent):
        x_m, y_m, theta_rad = event.odom_from_base.tolist()
        return items.odometry(event.stamp_ns, x_m, y_m, theta_rad)
    reading = event.reading
    return items.laser_scan(
        event.stamp_ns,
        reading.ranges_m,
        angle_min_rad=reading.geometry.first_bearing_rad,
        angle_increment_rad=reading.geometry.increment_rad,
        range_min_m=0.0,
        range_max_m=reading.range_max_m,
        sensor_id=reading.sensor_id,
    )
