"""Visual substitute for haptic feedback when a side is played with a mouse or keys. Pure: no Qt, no clock.

A player without a haptic device feels nothing, so the force is drawn: as a spring from the pointer to the stylus, and
as an arrow with its size in newtons. Only the player's own hand is ever drawn: the pointer is that of this window, the
force comes from the agent of the same side, and the stylus is the one in the station's view.
"""

from netboard.base.config import Config, Side
from netboard.stage.view import View
from netboard.windows.participant.scene import CURSOR_RADIUS, Grip, Point, to_grain
from netboard.windows.participant.words import DisplayTexts

ARROW_PER_FORCE = 0.04
"""Length of the arrow for a force of 1 N as drawn [m/N]."""

SMALLEST_FORCE = 0.02
"""Smaller forces are not drawn [N]."""

ARROW_WIDTH, HEAD_WIDTH, HEAD_LENGTH = 0.004, 0.014, 0.012
"""Width of the arrow's shaft, width and length of its head, as drawn [m]."""

LABEL_CLEAR, LABEL_GAP = 0.042, 0.016
"""Smallest distance of the arrow's label from the stylus, and its distance from the arrow's tip [m]."""

MARK_WIDTH = 0.044
"""Width of the bar that marks the height of the pointer [m]."""

TEETH, TOOTH_WIDTH = 6, 0.005
"""Number of the spring's teeth, and how far they stand out [1, m]."""


def grip_of(
    view: View | None,
    config: Config,
    words: DisplayTexts,
    station: Side,
    pointer: float | None,
    force: float | None,
    *,
    keys: bool,
) -> Grip:
    """Return what is drawn of the player's own hand; the vertical force is + = up, None if unknown [N]."""
    how = _how(words, station, keys) if pointer is not None else words.take_press if keys else words.take_point
    stylus = None if view is None else view.left if station == "left" else view.right
    if stylus is None or pointer is None:
        return Grip((how, words.play), asks=pointer is None)
    x = to_grain(-config.physics.l if station == "left" else config.physics.l)
    stylus, pointer = to_grain(stylus), to_grain(pointer)
    mark, spring = ((x - MARK_WIDTH / 2, pointer), (x + MARK_WIDTH / 2, pointer)), _spring(x, pointer, stylus)
    if force is None or abs(force) < SMALLEST_FORCE:
        return Grip((how, words.play), mark=mark, spring=spring)
    up = 1.0 if force > 0 else -1.0
    reach = CURSOR_RADIUS + to_grain(ARROW_PER_FORCE * abs(force))
    label_at = (x, stylus + up * max(reach + LABEL_GAP, LABEL_CLEAR))
    arrow, label = _arrow(x, stylus, reach, up), f"{abs(force):.1f} N"
    return Grip((how, words.play), mark=mark, spring=spring, arrow=arrow, label=label, label_at=label_at)


def _how(words: DisplayTexts, station: Side, keys: bool) -> str:
    """Return the sentence that says how to move the stylus."""
    how = (words.press if keys else words.point).format(end=words.end(station))
    return how[:1].upper() + how[1:]


def _spring(x: float, pointer: float, stylus: float) -> tuple[Point, ...]:
    """Corners of the spring from the pointer to the stylus [m]."""
    if pointer == stylus:
        return ()
    step = (stylus - pointer) / (TEETH + 1)
    teeth = ((x + (TOOTH_WIDTH if k % 2 else -TOOTH_WIDTH), pointer + (k + 0.5) * step) for k in range(1, TEETH))
    return ((x, pointer), (x, pointer + 0.5 * step), *teeth, (x, stylus - 0.5 * step), (x, stylus))


def _arrow(x: float, stylus: float, reach: float, up: float) -> tuple[Point, ...]:
    """Corners of an arrow from the rim of the stylus cursor to `reach` from its centre [m]."""
    neck = max(reach - HEAD_LENGTH, CURSOR_RADIUS)
    shaft, head = ARROW_WIDTH / 2, HEAD_WIDTH / 2
    outline = ((-shaft, CURSOR_RADIUS), (-shaft, neck), (-head, neck), (0.0, reach))
    mirrored = tuple((-aside, along) for aside, along in reversed(outline[:-1]))
    return tuple((x + aside, stylus + up * along) for aside, along in (*outline, *mirrored))
