"""Calibration: from held stylus positions to the transform from the device's frame to the scene's. Pure.

The zero is the stylus position at the neutral height. The workspace is the box between two opposite corners. The scale
is 1 if the box has room for the heights that the task needs; otherwise the scale enlarges the movement.
"""

from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from netboard.base import settings
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.number import number_of
from netboard.devices.contract.device import Box
from netboard.devices.contract.profile import MAX_SCALE, Placement
from netboard.devices.setup.loop import DeviceRun

STILL = 5e-3
"""Largest movement of a stylus that counts as held still [m]."""

MIN_SIDE = 0.01
"""Shortest plausible side of a workspace [m]."""

Point = tuple[float, float, float]


def held_at(track: DeviceRun) -> Point:
    """Return the position at which the stylus was held: the median along each axis."""
    moved = float(np.ptp(track.place, axis=0).max())
    if moved > STILL:
        raise NetboardError(
            f"the stylus moved by {moved * 1e3:.0f} mm while its position was taken, more than {STILL * 1e3:.0f} mm: "
            "hold it still, and try again"
        )
    x, y, z = np.median(track.place, axis=0)
    return float(x), float(y), float(z)


def neutral_at(track: DeviceRun) -> Point:
    """Return the position at which the stylus was held, where the device must be able to render forces."""
    if not track.ready.all():
        raise NetboardError(
            "the device is not ready for forces at the neutral height: home or calibrate it, take the stylus out of "
            "its holder and into its workspace, and try again"
        )
    return held_at(track)


def box_between(one: Point, other: Point) -> Box:
    """Return the box with these opposite corners."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    for axis, side in zip("xyz", high - low, strict=True):
        if side < MIN_SIDE:
            raise NetboardError(
                f"the two corners are {side * 1e3:.0f} mm apart along {axis}, expected at least "
                f"{MIN_SIDE * 1e3:.0f} mm: choose corners opposite each other in all three directions"
            )
    return Box(*map(float, low), *map(float, high))


def scale_for(zero_z: float, box: Box, needed: float) -> float:
    """Return the scale at which the heights that the task needs fit into the box [1].

    ``needed``: height above and below neutral that the task needs, ``task.stylus_range`` [m].
    """
    room, least = min(zero_z - box.z_min, box.z_max - zero_z), max(0.5 * MIN_SIDE, needed / MAX_SCALE)
    if room < least:
        raise NetboardError(
            f"the neutral height, {zero_z * 1e3:.0f} mm, is not well within the workspace, {box.z_min * 1e3:.0f} to "
            f"{box.z_max * 1e3:.0f} mm: the task needs at least {least * 1e3:.1f} mm above and below; measure again"
        )
    return max(1.0, needed / room)


def reach(place: Placement, own: Box | None) -> float:
    """Return how far the stylus can move up and down from neutral, in the scene [m].

    ``own``: the device's own workspace, if it is known.
    """
    box = Box(*place.box).within(own)
    return place.scale * min(place.zero_z - box.z_min, box.z_max - place.zero_z)


def placed(before: Placement, zero: Point, box: Box | None, needed: float, words: str) -> Placement:
    """Return the placement that follows from the measured positions.

    ``before``: previous placement; without a box, its workspace and scale are kept. ``needed``: height above and below
    neutral that the task needs [m].
    """
    x, y, z = zero
    after = replace(before, zero_x=x, zero_y=y, zero_z=z, calibrated=words)
    if box is None:
        return after
    return replace(after, scale=scale_for(z, box, needed), **box._asdict())


def with_values(before: Placement, given: Mapping[str, str], words: str) -> Placement:
    """Return a placement with values that were entered by hand.

    ``given``: keys of a profile's table ``placement``, with their values as text.
    """
    values: dict[str, object] = {**asdict(before), "calibrated": words}
    for key, word in given.items():
        try:
            values[key] = number_of(word)
        except ValueError:
            raise ConfigError(f"[placement] {key}: found {word}, expected a number") from None
    return settings.check(Placement, values, ("placement",))
