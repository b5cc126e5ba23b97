"""Signals in a person's run: their own stylus and its forces, and the board and ball that they saw.

In a dyad each person's file contains only their own side, because they saw only their own stylus: visibility rules hold
for shared data, too. The two files of a run together have both sides. Meanings and units come from the tick channel.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from netboard.base.config import Side
from netboard.recording.format.channels import CHANNELS, Field

FRAME = "room"
"""Name of the reference frame of positions."""

FRAME_TEXT = (
    "x out of the screen, towards the person; y to the person's right; z up. The origin is the device's neutral point"
)


@dataclass(frozen=True, slots=True)
class Signal:
    """A column of a motion file."""

    name: str
    field: str
    kind: str
    axis: str
    point: str
    # Meaning and SI unit, ``1`` for a dimensionless number.
    about: str
    unit: str


_FIELDS = {field.name: field for field in CHANNELS[0].columns}

_RATES = {
    "left_sent_vz": "rate of left_stylus_z",
    "right_sent_vz": "rate of right_stylus_z",
    "vz": "rate of board_z",
    "omega": "rate of board_tilt",
    "vp": "rate of ball_position",
}
"""Fields whose meaning refers to another field, under the name used here."""

_STYLUS = (
    ("x", "POS", "x", "x"),
    ("y", "POS", "y", "y"),
    ("z", "POS", "z", "sent_z"),
    ("vz", "VEL", "z", "sent_vz"),
    ("fresh", "MISC", "", "live"),
    ("sample", "MISC", "", "seq"),
    ("force_on_board", "MISC", "z", "coupling"),
    ("force_on_hand", "MISC", "z", "force"),
    ("force_rendered", "MISC", "z", "rendered"),
    ("safeguards", "MISC", "", "safeguards"),
)
"""Name, kind, axis, and field without its side."""

_SCENE = (
    ("board_z", "z", "board", "z"),
    ("board_vz", "z", "board", "vz"),
    ("board_tilt", "x", "board", "theta"),
    ("board_tilt_rate", "x", "board", "omega"),
    ("ball_position", "", "ball", "p"),
    ("ball_velocity", "", "ball", "vp"),
    ("phase", "", "trial", "phase"),
    ("target", "", "trial", "target"),
    ("trial", "", "trial", "trial"),
    ("attempt", "", "trial", "attempt"),
)
"""Name, axis, object, and field."""


def signals_of(sides: Sequence[Side]) -> tuple[Signal, ...]:
    """Return the signals of a person with the styluses of these sides."""
    return (*(signal for side in sides for signal in _of_stylus(side)), *_of_scene())


def _of_stylus(side: Side) -> Iterator[Signal]:
    for name, kind, axis, rest in _STYLUS:
        field = _FIELDS[f"{side}_{rest}"]
        point = f"{side}_stylus"
        yield Signal(f"{point}_{name}", field.name, kind, axis, point, _about(field), field.unit)


def _of_scene() -> Iterator[Signal]:
    for name, axis, point, rest in _SCENE:
        field = _FIELDS[rest]
        yield Signal(name, field.name, "MISC", axis, point, _about(field), field.unit)


def _about(field: Field) -> str:
    return _RATES.get(field.name, field.text)
