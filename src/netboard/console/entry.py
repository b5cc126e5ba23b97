"""What the session's form asks, and what it takes for an answer. Pure: no Qt."""

import json
import re
from dataclasses import asdict, dataclass, fields

from netboard.tables.experiment import Session

ID = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""What a label or a pseudonym is made of."""

ASKED = {"name": "Session", "participant_a": "Participant A", "participant_b": "Participant B"}
"""The labels that are asked for, and what people call them."""


@dataclass(frozen=True, slots=True)
class Entry:
    """The answers, under the names that `netboard.tables.experiment.Session` has for them.

    Attributes
    ----------
    name : str
        Label of the session.
    participant_a, participant_b : str
        Pseudonymous ids.
    hand_a, hand_b : str
        Dominant hands: ``right`` or ``left``.
    seat_a : str
        Where participant A sits: ``left`` or ``right``.
    consent : bool
        Whether both have given their consent.
    pilot : bool
        Whether this is a pilot run.
    """

    name: str
    participant_a: str
    participant_b: str
    hand_a: str
    hand_b: str
    seat_a: str
    consent: bool
    pilot: bool


def first_entry(session: Session) -> Entry:
    """What the form shows before anything has been filled in: what the configuration says, and no consent.

    Parameters
    ----------
    session : Session
        The configuration's table.

    Returns
    -------
    Entry
        The answers.
    """
    known = {field.name: getattr(session, field.name) for field in fields(Entry)}
    return Entry(**{**known, "consent": False})


def problems(entry: Entry) -> dict[str, str]:
    """What is wrong with the answers.

    Parameters
    ----------
    entry : Entry
        The answers.

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
    """Write the answers as the argument of the command ``open``.

    Parameters
    ----------
    entry : Entry
        The answers.

    Returns
    -------
    str
        JSON text.
    """
    return json.dumps(asdict(entry))
