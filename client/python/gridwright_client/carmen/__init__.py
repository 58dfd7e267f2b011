"""Logs of the Carnegie Mellon robot navigation toolkit (CARMEN)."""

from gridwright_client.carmen.log import read_log
from gridwright_client.carmen.readings import (
    BeamGeometry,
    CarmenLog,
    LaserReading,
    MalformedLine,
    OdometryReading,
    TruePoseReading,
)

__all__ = [
    "BeamGeometry",
    "CarmenLog",
    "LaserReading",
    "MalformedLine",
    "OdometryReading",
    "TruePoseReading",
    "read_log",
]
