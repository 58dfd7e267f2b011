"""Reading a whole log: lines to messages, and messages to readings by the log's own conventions."""

import re
from collections import defaultdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from gridwright_client.carmen import geometry
from gridwright_client.carmen.fields import MalformedLineError
from gridwright_client.carmen.lines import LogText, read_text
from gridwright_client.carmen.messages import PARSERS, DeclaredBeams, Message, Parameter, Sweep
from gridwright_client.carmen.readings import (
    BeamGeometry,
    CarmenLog,
    LaserReading,
    MalformedLine,
    Reading,
)
from gridwright_client.carmen.saturation import no_return_limit_m

_MESSAGE_NAME = re.compile(rb"[A-Za-z_][A-Za-z0-9_]*")


def read_log(path: Path) -> CarmenLog:
    """Reads a CARMEN log, plain or gzip.

    A line that is malformed is left out and listed; only a file that cannot be opened raises
    (OSError). Parameters hold for the whole log, the last value of each.
    """
    log = CarmenLog()
    messages = _read_messages(read_text(path), log)
    sweeps = [message for message in messages if isinstance(message, Sweep)]
    _settle_mountings(sweeps, log)
    lasers = _Lasers(sweeps, log)
    for message in messages:
        log.readings.append(lasers.resolve(message) if isinstance(message, Sweep) else message)
    return log


def _read_messages(text: LogText, log: CarmenLog) -> list[Reading | Sweep]:
    messages: list[Reading | Sweep] = []
    line_number = 0
    for line_number, line in text.lines():
        try:
            message = _parse(line_number, line, log)
        except MalformedLineError as error:
            log.malformed.append(MalformedLine(line_number, str(error)))
            continue
        if isinstance(message, Parameter):
            log.parameters[message.name] = message.value
        elif message is not None:
            messages.append(message)
    if text.damage is not None:
        log.malformed.append(MalformedLine(line_number + 1, text.damage))
    return messages


def _parse(line_number: int, line: bytes, log: CarmenLog) -> Message | None:
    """The line's message; None for a comment, an empty line and a message that is not read."""
    fields = line.split()
    if not fields or fields[0].startswith(b"#"):
        return None
    if not line.isascii():
        _expect_text(line)
    name = fields[0]
    parser = PARSERS.get(name)
    if parser is None:
        if not _MESSAGE_NAME.fullmatch(name):
            raise MalformedLineError("the line does not begin with a message's name")
        log.ignored[name.decode("ascii")] += 1
        return None
    message = parser(line_number, fields)
    log.messages[name.decode("ascii")] += 1
    return message


def _expect_text(line: bytes) -> None:
    try:
        line.decode("utf-8")
    except UnicodeDecodeError as error:
        raise MalformedLineError(f"byte {error.start + 1} is not text") from None


def _settle_mountings(sweeps: list[Sweep], log: CarmenLog) -> None:
    by_sensor: dict[str, list[Sweep]] = defaultdict(list)
    for sweep in sweeps:
        by_sensor[sweep.sensor_id].append(sweep)
    for sensor_id, group in by_sensor.items():
        robot = [sweep for sweep in group if sweep.message.startswith("ROBOTLASER")]
        measured = [sweep.base_from_laser for sweep in robot or group if sweep.base_from_laser is not None]
        log.base_from_laser[sensor_id] = geometry.mounting(sensor_id, measured, bool(robot), log.parameters)


class _Lasers:
    """Resolves sweeps to readings; what sweeps of one kind have in common is worked out once."""

    def __init__(self, sweeps: list[Sweep], log: CarmenLog) -> None:
        self._parameters = log.parameters
        self._geometries: dict[tuple[str, int, DeclaredBeams | None], BeamGeometry] = {}
        groups: dict[tuple[str, float | None], list[NDArray[np.float32]]] = defaultdict(list)
        for sweep in sweeps:
            groups[self._reach_key(sweep)].append(sweep.ranges_m)
        self._limits_m = {key: no_return_limit_m(group, key[1]) for key, group in groups.items()}

    def resolve(self, sweep: Sweep) -> LaserReading:
        key = (sweep.sensor_id, len(sweep.ranges_m), sweep.declared)
        if key not in self._geometries:
            self._geometries[key] = geometry.beam_geometry(
                len(sweep.ranges_m), sweep.sensor_id, sweep.declared, self._parameters
            )
        limit_m = self._limits_m[self._reach_key(sweep)]
        return LaserReading(
            line_number=sweep.line_number,
            stamp_ns=sweep.stamp_ns,
            sensor_id=sweep.sensor_id,
            geometry=self._geometries[key],
            # Infinite, for 51.16 as a float32 is below 51.16 as a float64: a wall to whoever compares.
            ranges_m=np.where(sweep.ranges_m >= np.float32(limit_m), np.float32(np.inf), sweep.ranges_m),
            range_max_m=limit_m,
            odom_from_base=sweep.odom_from_base,
        )

    def _reach_key(self, sweep: Sweep) -> tuple[str, float | None]:
        """Sweeps with the same key share one limit: same laser, same named maximum."""
        if sweep.declared is not None:
            return sweep.sensor_id, sweep.declared.maximum_range_m
        return sweep.sensor_id, geometry.parameter(self._parameters, f"robot_{sweep.sensor_id}_laser_max")
