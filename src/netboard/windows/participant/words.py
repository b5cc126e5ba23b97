"""The texts of a display, in one language. Pure: TOML in, `DisplayTexts` out.

Every text is a field of `DisplayTexts`; a language is a TOML file with exactly these keys. The display fills in the
placeholders in braces; they must be the same in every language. A missing or unknown key is a `ConfigError` that names
it, so that a display cannot miss a text in the middle of a session.
"""

import string
from dataclasses import dataclass, fields

from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError
from netboard.base.nearest import one_of
from netboard.base.settings import parse_toml
from netboard.base.tables.rig import MOUSE, WITHOUT_FORCE


@dataclass(frozen=True, slots=True)
class DisplayTexts:
    """All texts of a display."""

    decimal: str
    # The two ends of the board, as the object of a sentence.
    left_end: str
    right_end: str
    pilot: str
    # The current block and trial, and the next block.
    block: str
    trial: str
    next: str
    # Before a block: headline, what to do in the meantime, headline of a rest.
    ready: str
    wait: str
    rest: str
    # Headline and sentence for a participant who does not take part in a block.
    away: str
    away_text: str
    level: str
    hold: str
    succeeded: str
    new_best: str
    failed: str
    fell: str
    paused: str
    # Why a block is paused, or does not end yet: see `netboard.stage.curtain.Pause`.
    pause_operator: str
    pause_fault: str
    pause_stop: str
    pause_repeats: str
    pause_decision: str
    again: str
    last: str
    best: str
    block_done: str
    finished: str
    waiting: str
    server: str
    lost: str
    over: str
    who_dyadic: str
    who_still: str
    who_bimanual: str
    # Instructions: what to do with and without a ball; what is felt with haptic feedback on and off, and with a mouse.
    task: str
    task_board: str
    felt: str
    unfelt: str
    drawn: str
    point: str
    press: str
    take_point: str
    take_press: str
    play: str
    # Buttons of a form, and what is shown after it.
    form_back: str
    form_skip: str
    form_next: str
    form_done: str

    def seconds(self, time: float, digits: int = 2) -> str:
        """Format a time with the decimal sign of this language."""
        return f"{time:.{digits}f}".replace(".", self.decimal)

    def end(self, side: Side) -> str:
        """Return the name of an end of the board."""
        return self.left_end if side == "left" else self.right_end


FILLED: dict[str, set[str]] = {
    **{key: {"block", "blocks"} for key in ("block", "next", "block_done")},
    "trial": {"trial", "trials"},
    **{key: {"time"} for key in ("last", "best")},
    **{key: {"end"} for key in ("who_dyadic", "who_still", "point", "press")},
    "server": {"host", "port"},
    "task": {"hold"},
}
"""Placeholders of each text that has any."""

_SAMPLES = {"time": "1.00", "hold": "1.0", "end": "the left end", "host": "lab0"}
"""Values of the placeholders that are texts; all others are whole numbers."""


def parse_words(text: str, source: str) -> DisplayTexts:
    """Parse the texts of a language; raise ConfigError with one line per problem if they are not valid."""
    found = parse_toml(text, source)
    known = [field.name for field in fields(DisplayTexts)]
    problems = [f"{source}: {key}: unknown text, expected {one_of(key, known)}" for key in found.keys() - set(known)]
    for key in known:
        problem = _problem(key, found.get(key))
        if problem:
            problems.append(f"{source}: {key}: {problem}")
    if problems:
        raise ConfigError("\n".join(problems))
    return DisplayTexts(**found)


def _problem(key: str, text: object) -> str:
    """Describe what is wrong with a text; empty if nothing is."""
    if text is None:
        return "missing; expected every text"
    if not isinstance(text, str) or not text:
        return f"found {text!r}, expected a text that is not empty"
    wanted = FILLED.get(key, set())
    try:
        placeholders = {name for _, name, *_ in string.Formatter().parse(text) if name is not None}
    except ValueError as error:
        return f"found {text!r}: {error}"
    if placeholders != wanted:
        listed = " and ".join(f"{{{name}}}" for name in sorted(wanted))
        return f"found {text!r}, expected {listed or 'no'} placeholders"
    try:
        text.format(**{name: _SAMPLES.get(name, 1) for name in wanted})
    except (ValueError, AttributeError, LookupError) as error:  # otherwise only in the middle of a session
        return f"found {text!r}: {error}"
    return ""


def instructions(config: Config, words: DisplayTexts, station: Side) -> str:
    """Return the instructions before a block: those of the block, or the standard ones of its condition."""
    block = config.block
    if block.instructions:
        return block.instructions
    other = block.right if station == "left" else block.left
    who = words.who_dyadic if other != "still" else words.who_still
    if block.configuration == "bimanual":
        who = words.who_bimanual
    task = words.task if config.physics.balls else words.task_board
    hold = words.seconds(config.task.hold_time, 1)
    felt = _felt(config, words, station)
    return f"{who.format(end=words.end(station))}\n\n{task.format(hold=hold)}\n\n{felt}"


def _felt(config: Config, words: DisplayTexts, station: Side) -> str:
    """Return the sentence on haptic feedback: a device that renders no force cannot be felt."""
    device = config.agents.of(station).device
    if not config.block.haptics or (device in WITHOUT_FORCE and device != MOUSE):
        return words.unfelt
    return words.drawn if device == MOUSE else words.felt
