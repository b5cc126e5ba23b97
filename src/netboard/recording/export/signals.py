"""What is told of a person's run: the own stylus and its forces, and the board and the ball that the person saw.

In a dyad each gets the own side only, as each saw the own stylus only: the curtain holds in what is shared, too. The
two files of a run together have both sides. What a signal means, and its unit, is what the tick's channel says.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from netboard.base.config import Side
from netboard.recording.format.channels import CHANNELS, Field

FRAME = "room"
"""Name of the frame of reference of positions."""

FRAME_TEXT = (
    "x out of the screen, towards the person; y to the person's right; z up. The origin is the device's neutral point"
)
"""What that frame is."""


@dataclass(frozen=True, slots=True)
class Signal:
    """A column.

    Attributes
    ----------
    about, unit : str
        What it means, and its SI unit, ``1`` for a pure number.
    """

    name: str
    field: str
    kind: str
    axis: str
    point: str
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
"""What means something with regard to another field, in the names it has here."""

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
"""Name, axis, what it is of, and field."""


def signals_of(sides: Sequence[Side]) -> tuple[Signal, ...]:
    """List the signals of somebody with the styluses of some sides."""
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
