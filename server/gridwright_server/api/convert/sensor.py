"""Sensor messages to the session's items."""

import math
from collections.abc import Mapping

import numpy as np
from gridwright.v1 import mapping_service_pb2 as pb
from gridwright.v1.sensor_pb2 import LaserScan, Odometry

from gridwright_server.api.convert.checks import Checks
from gridwright_server.errors import FieldViolation, InvalidArgumentError
from gridwright_server.session.items import InvalidData, OdometryReading, SensorItem
from gridwright_server.slam.types import Pose, Scan

LARGEST_BATCH = 1024
_MOST_BEAMS = 65_536
_LONGEST_RANGE_M = 1e6

Lasers = Mapping[str, Pose]


def scan_request_item(request: pb.AddLaserScanRequest, lasers: Lasers) -> SensorItem:
    """The scan of a unary call; raises InvalidArgumentError."""
    checks = Checks()
    scan = _scan(request.scan, lasers, checks) if checks.present(request, "", "scan") else None
    if scan is None:
        raise InvalidArgumentError(checks.violations)
    return SensorItem(scan, pb.SensorItem(scan=request.scan).SerializeToString)


def odometry_request_item(request: pb.AddOdometryRequest) -> SensorItem:
    """The reading of a unary call; raises InvalidArgumentError."""
    checks = Checks()
    if not checks.present(request, "", "odometry"):
        raise InvalidArgumentError(checks.violations)
    reading = _odometry(request.odometry, checks)
    checks.raise_if_any()
    return SensorItem(reading, pb.SensorItem(odometry=request.odometry).SerializeToString)


def stream_item(message: pb.SensorItem, lasers: Lasers) -> SensorItem:
    """An item of a stream; one that breaks a rule becomes InvalidData, which uses up its number."""
    if message.sequence_number == 0:
        violation = FieldViolation("sequence_number", "must be set: numbers count from 1")
        return SensorItem(InvalidData((violation,)), record=None)
    return SensorItem(_data(message, lasers), message.SerializeToString, message.sequence_number)


def recorded_item(message: pb.SensorItem, lasers: Lasers) -> SensorItem:
    """An item from the journal; without a number it came by a unary call."""
    return SensorItem(_data(message, lasers), record=None, sequence_number=message.sequence_number or None)


def batch_of(request: pb.StreamSensorDataRequest) -> pb.SensorBatch:
    """The batch of every request but the first; raises InvalidArgumentError."""
    checks = Checks()
    if request.WhichOneof("payload") != "batch":
        checks.report("payload", "must be a batch: only the first request is a start")
    elif len(request.batch.items) > LARGEST_BATCH:
        checks.report("batch.items", f"holds {len(request.batch.items)} items, at most {LARGEST_BATCH}")
    checks.raise_if_any()
    return request.batch


def start_of(request: pb.StreamSensorDataRequest | None) -> pb.StreamStart:
    """The start that a stream's first request must be; raises InvalidArgumentError."""
    checks = Checks()
    if request is None or request.WhichOneof("payload") != "start":
        checks.report("payload", "the first request must be a start")
        raise InvalidArgumentError(checks.violations)
    checks.identifier("start.session_id", request.start.session_id)
    checks.raise_if_any()
    return request.start


def _data(message: pb.SensorItem, lasers: Lasers) -> Scan | OdometryReading | InvalidData:
    checks = Checks()
    data: Scan | OdometryReading | None = None
    kind = message.WhichOneof("data")
    if kind == "scan":
        data = _scan(message.scan, lasers, checks)
    elif kind == "odometry":
        data = _odometry(message.odometry, checks)
    else:
        checks.report("data", "must be a scan or odometry")
    return InvalidData(tuple(checks.violations)) if checks.violations or data is None else data


def _scan(message: LaserScan, lasers: Lasers, checks: Checks) -> Scan | None:
    """None where a rule is broken. Ranges may hold NaN and Inf (REP-117), nothing else may."""
    beams = len(message.ranges_meters)
    if not 1 <= beams <= _MOST_BEAMS:
        checks.report("scan.ranges_meters", f"holds {beams} ranges, must hold 1 to {_MOST_BEAMS}")
    stamp_ns = checks.stamp_ns(message, "scan.")
    _check_geometry(message, checks)
    base_from_laser = _mounting(message.sensor_id, lasers, checks)
    if checks.violations:
        return None
    steps = np.arange(beams, dtype=np.float64)
    return Scan(
        stamp_ns=stamp_ns,
        bearings_rad=message.angle_min_radians + message.angle_increment_radians * steps,
        ranges_m=np.array(message.ranges_meters, dtype=np.float64),
        range_min_m=message.range_min_meters,
        range_max_m=message.range_max_meters,
        base_from_laser=base_from_laser,
    )


def _check_geometry(message: LaserScan, checks: Checks) -> None:
    checks.within("scan.angle_min_radians", message.angle_min_radians, -math.tau, math.tau)
    checks.within("scan.angle_increment_radians", message.angle_increment_radians, -math.tau, math.tau)
    if message.angle_increment_radians == 0.0:
        checks.report("scan.angle_increment_radians", "must not be 0")
    checks.within("scan.range_min_meters", message.range_min_meters, 0.0, _LONGEST_RANGE_M)
    checks.within("scan.range_max_meters", message.range_max_meters, 0.0, _LONGEST_RANGE_M)
    if message.range_min_meters >= message.range_max_meters:
        checks.report("scan.range_max_meters", "must be greater than range_min_meters")


def _mounting(sensor_id: str, lasers: Lasers, checks: Checks) -> Pose:
    if not sensor_id and len(lasers) == 1:
        return next(iter(lasers.values()))
    if not sensor_id:
        checks.report("scan.sensor_id", "must be set where the session has several lasers")
    elif sensor_id not in lasers:
        checks.report("scan.sensor_id", "names none of the session's lasers")
    return lasers.get(sensor_id, np.zeros(3))


def _odometry(message: Odometry, checks: Checks) -> OdometryReading:
    stamp_ns = checks.stamp_ns(message, "odometry.")
    pose = np.zeros(3)
    if checks.present(message, "odometry.", "pose"):
        pose = checks.pose(message.pose, "odometry.pose.")
    return OdometryReading(stamp_ns, pose)
