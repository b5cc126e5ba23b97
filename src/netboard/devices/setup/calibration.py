"""From where an operator held the stylus to how the device's frame becomes the scene's. Pure.

The zero is where the stylus is at the neutral height. The workspace is the box between two of its corners. Lengths stay
true to size wherever the box has room for the heights the task needs; where it has not, the scale makes up for it.
"""

from collections.abc import Mapping
from dataclasses import asdict, replace

import numpy as np

from netboard.base import settings
from netboard.base.errors import ConfigError, NetboardError
from netboard.devices.contract.device import Box
from netboard.devices.contract.profile import Placement
from netboard.devices.setup.loop import Track

STILL = 5e-3
"""A stylus that moves further than this was not held still [m]."""

LEAST_SIDE = 0.01
"""A workspace with a shorter side is a mistake [m]."""

Point = tuple[float, float, float]


def held_at(track: Track) -> Point:
    """Where the stylus was held: the medians."""
    moved = float(np.ptp(track.place, axis=0).max())
    if moved > STILL:
        raise NetboardError(
            f"the stylus moved by {moved * 1e3:.0f} mm while its position was taken, more than {STILL * 1e3:.0f} mm: "
            "hold it still, and try again"
        )
    x, y, z = np.median(track.place, axis=0)
    return float(x), float(y), float(z)


def box_between(one: Point, other: Point) -> Box:
    """Make the box that has these two corners opposite each other."""
    low, high = np.minimum(one, other), np.maximum(one, other)
    for axis, side in zip("xyz", high - low, strict=True):
        if side < LEAST_SIDE:
            raise NetboardError(
                f"the two corners are {side * 1e3:.0f} mm apart along {axis}, expected at least "
                f"{LEAST_SIDE * 1e3:.0f} mm: choose corners opposite each other in all three directions"
            )
    return Box(*map(float, low), *map(float, high))


def scale_for(zero_z: float, box: Box, needed: float) -> float:
    """Scale with which the heights that the task needs have room.

    Parameters
    ----------
    needed : float
        Height above and below the neutral one that the task needs, ``task.stylus_range`` [m].
    """
    room = min(zero_z - box.z_min, box.z_max - zero_z)
    if room < 0.5 * LEAST_SIDE:
        raise NetboardError(
            f"the neutral height, {zero_z * 1e3:.0f} mm, is not well within the workspace, {box.z_min * 1e3:.0f} to "
            f"{box.z_max * 1e3:.0f} mm: take the corners anew"
        )
    return max(1.0, needed / room)


def placed(before: Placement, zero: Point, box: Box | None, needed: float, words: str) -> Placement:
    """Make a placement of what was measured.

    Parameters
    ----------
    before : Placement
        What there was; without a box, workspace and scale stay as they were.
    needed : float
        Height above and below the neutral one that the task needs [m].
    """
    x, y, z = zero
    after = replace(before, zero_x=x, zero_y=y, zero_z=z, calibrated=words)
    if box is None:
        return after
    return replace(after, scale=scale_for(z, box, needed), **box._asdict())


def with_values(before: Placement, given: Mapping[str, str], words: str) -> Placement:
    """Make a placement of values that were given by hand.

    Parameters
    ----------
    given : mapping of str to str
        Names of keys of a profile's table ``placement``, and their values as written.
    """
    values: dict[str, object] = {**asdict(before), "calibrated": words}
    for key, word in given.items():
        try:
            values[key] = float(word)
        except ValueError:
            raise ConfigError(f"[placement] {key}: found {word}, expected a number") from None
    return settings.check(Placement, values, ("placement",))
