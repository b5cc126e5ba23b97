"""What the session's form asks, and what it takes for an answer. Pure: no Qt."""

import json
import re
from dataclasses import asdict, dataclass, fields

from netboard.base.tables.experiment import Session

ID = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""What a label or a pseudonym is made of."""

ASKED = {"name": "Session", "participant_a": "Participant A", "participant_b": "Participant B"}
"""The labels that are asked for, and what people call them."""


@dataclass(frozen=True, slots=True)
class Entry:
    """The answers, under the names that `netboard.base.tables.experiment.Session` has for them."""

    name: str
    participant_a: str
    participant_b: str
    hand_a: str
    hand_b: str
    seat_a: str
    consent: bool
    pilot: bool


def first_entry(session: Session) -> Entry:
    """What the form shows before anything has been filled in: what the configuration says, and no consent."""
    known = {field.name: getattr(session, field.name) for field in fields(Entry)}
    return Entry(**{**known, "consent": False})


def problems(entry: Entry) -> dict[str, str]:
    """What is wrong with the answers.

    Returns
    -------
    dict of str
        For each field that is wrong, a sentence; empty if nothing is.
    """
    found: dict[str, str] = {}
    for name, called in ASKED.items():
        answer = getattr(entry, name)
        if not ID.fullmatch(answer):
            shown = f"found {answer!r}" if answer else "is empty"
            found[name] = f"{called}: {shown}, expected letters, digits, - and _ only, such as P07. No real names."
    if not found and entry.participant_a == entry.participant_b:
        found["participant_b"] = f"Participant B: found {entry.participant_b!r} for both, expected two ids."
    if not entry.consent and not entry.pilot:
        found["consent"] = "Consent: not ticked; without it only a pilot can be run."
    return found


def as_json(entry: Entry) -> str:
    """Write the answers as the argument of the command ``open``."""
    return json.dumps(asdict(entry))
