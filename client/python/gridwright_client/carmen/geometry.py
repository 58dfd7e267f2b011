"""CARMEN's conventions on where beams point and where lasers are mounted."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from gridwright_client.carmen.messages import DeclaredBeams
from gridwright_client.carmen.readings import REAR, BeamGeometry
from gridwright_client.se2 import Poses, wrap

_LARGEST_MOUNTING_M = 2.0
_MOUNTING_AGREEMENT_M = 0.02
_MOUNTING_AGREEMENT_RAD = 0.02


def beam_geometry(
    beams: int, sensor_id: str, declared: DeclaredBeams | None, parameters: Mapping[str, str]
) -> BeamGeometry:
    """Where a sweep's beams point: as its message says, or the parameters, or the number of beams.

    By number: half a turn from -90 degrees, in `beams` steps where that is even (180: 1 degree,
    360: 0.5 degrees) and in `beams - 1` where it is odd, both ends included (181, 361).
    """
    if declared is not None:
        return BeamGeometry(declared.start_angle_rad, _declared_increment(beams, declared), beams)
    resolution_deg = parameter(parameters, f"laser_{sensor_id}_laser_resolution")
    if resolution_deg is not None and resolution_deg > 0.0:
        increment = math.radians(resolution_deg)
    else:
        increment = math.pi / max(beams - beams % 2, 1)
    return BeamGeometry(-math.pi / 2, increment, beams)


def _declared_increment(beams: int, declared: DeclaredBeams) -> float:
    if declared.resolution_rad != 0.0:
        return declared.resolution_rad
    return declared.field_of_view_rad / max(beams - 1, 1)


def mounting(
    sensor_id: str, measured: Sequence[Poses], posed_by_message: bool, parameters: Mapping[str, str]
) -> Poses:
    """base_from_laser of a laser, shape (3,).

    `measured` are the mountings between the two poses of each of its messages. They are believed
    where the message is a ROBOTLASER, whose two poses are of the same moment (`posed_by_message`);
    next come the parameters; and without those an FLASER's or RLASER's two poses, provided that they
    agree throughout the log: in a corrected log the laser's pose is the corrected one.
    """
    centre = _agreed(measured)
    if posed_by_message and centre is not None:
        return centre
    forward = parameter(parameters, f"robot_{sensor_id}laser_offset")
    left = parameter(parameters, f"robot_{sensor_id}laser_side_offset")
    turn_deg = parameter(parameters, f"robot_{sensor_id}laser_angular_offset")
    default_turn_deg = 180.0 if sensor_id == REAR else 0.0
    is_named = (forward, left, turn_deg) != (None, None, None)
    # Some programs wrote the robot's pose for the rear laser's: one that looks forward is not believed.
    if not is_named and centre is not None and abs(wrap(centre[2] - math.radians(default_turn_deg))) < 1.0:
        return centre
    turn = math.radians(default_turn_deg if turn_deg is None else turn_deg)
    return np.array((forward or 0.0, left or 0.0, turn))


def _agreed(measured: Sequence[Poses]) -> Poses | None:
    """What nine in ten measured mountings agree on, if they do and it fits on a robot."""
    if not measured:
        return None
    stack = np.array(measured)
    stack[:, 2] = stack[0, 2] + wrap(stack[:, 2] - stack[0, 2])  # no jump by a turn in the median
    centre = np.median(stack, axis=0)
    off_m = np.hypot(*(stack[:, :2] - centre[:2]).T)
    off_rad = np.abs(stack[:, 2] - centre[2])
    agreeing = (off_m < _MOUNTING_AGREEMENT_M) & (off_rad < _MOUNTING_AGREEMENT_RAD)
    if agreeing.mean() < 0.9 or np.hypot(*centre[:2]) > _LARGEST_MOUNTING_M:
        return None
    # Six decimals, as logs have them: the poses' rounding is no mounting.
    return np.array((*np.round(centre[:2], 6), round(float(wrap(centre[2])), 6))) + 0.0


def parameter(parameters: Mapping[str, str], name: str) -> float | None:
    """A parameter's finite number, or None."""
    try:
        value = float(parameters[name])
    except (KeyError, ValueError):
        return None
    return value if math.isfinite(value) else None
