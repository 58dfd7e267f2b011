"""The mapper's configuration: one frozen class per stage, each field with default and bounds.

Field names equal those of `gridwright.v1.MapperConfig`, so the wire needs no table of its own.
`docs/configuration.md` tells what each does and which measurement chose its default.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, fields, is_dataclass
from typing import Any

from gridwright_server.errors import FieldViolation, InvalidArgumentError


def bounded(default: float, low: float, high: float) -> Any:
    """A dataclass field whose value must lie in [low, high]."""
    return field(default=default, metadata={"low": low, "high": high})


@dataclass(frozen=True)
class GridConfig:
    """The multilevel occupancy grid (4.2)."""

    resolution_meters: float = bounded(0.04, 0.005, 1.0)
    coarse_factor: int = bounded(10, 2, 64)
    hit_log_odds: float = bounded(0.9, 0.01, 10.0)
    free_log_odds: float = bounded(0.08, 0.01, 10.0)
    log_odds_limit: float = bounded(4.0, 0.1, 20.0)


@dataclass(frozen=True)
class MotionConfig:
    """The motion filter and the odometry's error model."""

    update_distance_meters: float = bounded(0.2, 0.0, 10.0)
    update_angle_radians: float = bounded(0.2, 0.0, math.pi)
    update_score: float = bounded(0.6, 0.0, 1.0)
    translation_sigma_per_meter: float = bounded(0.1, 0.0, 10.0)
    translation_sigma_per_radian: float = bounded(0.05, 0.0, 10.0)
    rotation_sigma_per_meter: float = bounded(0.05, 0.0, 10.0)
    rotation_sigma_per_radian: float = bounded(0.1, 0.0, 10.0)
    translation_sigma_floor_meters: float = bounded(0.03, 0.0001, 10.0)
    rotation_sigma_floor_radians: float = bounded(0.03, 0.0001, math.pi)


@dataclass(frozen=True)
class SensorConfig:
    """The observation model (4.20)."""

    usable_range_meters: float = bounded(60.0, 0.1, 1000.0)
    hit_sigma_meters: float = bounded(0.06, 0.001, 10.0)
    outlier_probability: float = bounded(0.05, 0.0001, 0.9999)
    likelihood_gain: float = bounded(4.0, 0.0001, 100.0)
    weight_gain: float = bounded(0.2, 0.0, 100.0)


@dataclass(frozen=True)
class MatchingConfig:
    """The exhaustive two-level search (4.2.2)."""

    window_meters: float = bounded(0.4, 0.01, 10.0)
    window_radians: float = bounded(0.25, 0.001, math.pi)
    angle_step_radians: float = bounded(0.0087, 0.001, 1.0)
    minimum_score: float = bounded(0.3, 0.0, 1.0)
    doubtful_score: float = bounded(0.6, 0.0, 1.0)
    widening: int = bounded(3, 1, 10)


@dataclass(frozen=True)
class ProposalConfig:
    """The lattice of poses that the improved proposal's Gaussian is fitted to (4.21-4.24)."""

    extent_meters: float = bounded(0.06, 0.001, 1.0)
    extent_radians: float = bounded(0.015, 0.0001, 1.0)
    samples_per_axis: int = bounded(5, 3, 15)


@dataclass(frozen=True)
class ResamplingConfig:
    """When to resample."""

    threshold_ratio: float = bounded(0.5, 0.0, 1.0)


@dataclass(frozen=True)
class MapperConfig:
    """Everything that, with the seed and the sensor data, determines a map."""

    particles: int = bounded(30, 1, 10_000)
    grid: GridConfig = field(default_factory=GridConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    sensor: SensorConfig = field(default_factory=SensorConfig)
    matching: MatchingConfig = field(default_factory=MatchingConfig)
    proposal: ProposalConfig = field(default_factory=ProposalConfig)
    resampling: ResamplingConfig = field(default_factory=ResamplingConfig)

    def check(self) -> None:
        """Raises InvalidArgumentError naming every field outside its bounds."""
        violations = list(_violations(self, "config"))
        if violations:
            raise InvalidArgumentError(violations)


def _violations(stage: Any, path: str) -> Iterator[FieldViolation]:
    for entry in fields(stage):
        value = getattr(stage, entry.name)
        name = f"{path}.{entry.name}"
        if is_dataclass(value):
            yield from _violations(value, name)
        elif not entry.metadata["low"] <= value <= entry.metadata["high"]:  # also true of NaN
            low, high = entry.metadata["low"], entry.metadata["high"]
            yield FieldViolation(name, f"is {value:g}, must lie in [{low:g}, {high:g}]")
