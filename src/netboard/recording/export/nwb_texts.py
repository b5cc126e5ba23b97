"""Texts of an NWB file."""

from netboard.recording.export.runs import Person, Run
from netboard.recording.export.task import ATTEMPT_TEXTS, HAPPENED_TEXTS, TASK_TEXT

KEYWORDS = ("haptics", "dyad", "joint action", "motor control")
"""Keywords for searches."""

UNITS = {
    "m": "meters",
    "m/s": "meters/second",
    "rad": "radians",
    "rad/s": "radians/second",
    "N": "newtons",
    "1": "n/a",
}
"""Names of units by symbol."""

UNKNOWN_AGE = "P0D/"
"""Age range for archives that require an age: netboard does not record it, so any age from birth."""

COLUMNS = {
    "levelling_time": "when the levelling before it began [s]",
    **ATTEMPT_TEXTS,
    "condition": "configuration of the block, and what the hands feel",
    "force_scale": "what is felt is multiplied by this [1]",
    "force_delay": "what is felt comes so much later [s]",
}
"""Columns of the trials table, besides start (the release of the ball) and stop."""

EVENTS = "What changed the phase of a trial, at the tick that decided it. " + "; ".join(
    f"{name}: {text}" for name, text in HAPPENED_TEXTS.items()
)
"""Description of the events table."""


def description(run: Run, person: Person) -> str:
    """Describe the experiment."""
    block = run.config.block
    hands = f"the {person.sides[0]} stylus" if len(person.sides) == 1 else "both styluses"
    label = f" ({block.label})" if block.label else ""
    return (
        f"{TASK_TEXT} This is run {run.number} of session {run.session}: block {block.number} of "
        f"{block.blocks}{label}, {block.configuration}, felt force: {block.force}. The subject moved {hands}."
    )
