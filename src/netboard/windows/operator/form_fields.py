"""The fields of the session's form, and their checks. Pure: no Qt."""

import json
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields

from netboard.base.tables.experiment import Session
from netboard.nodes.server.stand_ins import names

ID = re.compile(r"[A-Za-z0-9_-]{1,64}")
"""Valid session names and pseudonyms."""

ASKED = {"name": "Session", "participant_a": "Participant A", "participant_b": "Participant B"}
"""Text fields with their labels."""


@dataclass(frozen=True, slots=True)
class FormAnswers:
    """The answers, named as in `netboard.base.tables.experiment.Session`."""

    name: str
    participant_a: str
    participant_b: str
    hand_a: str
    hand_b: str
    seat_a: str
    consent: bool
    pilot: bool


def first_entry(session: Session) -> FormAnswers:
    """Return the initial answers: those of the configuration, without consent."""
    known = {field.name: getattr(session, field.name) for field in fields(FormAnswers)}
    return FormAnswers(**{**known, "consent": False})


def problems(entry: FormAnswers) -> dict[str, str]:
    """Return a sentence for each invalid field; empty if all are valid."""
    found: dict[str, str] = {}
    for name, called in ASKED.items():
        answer = getattr(entry, name)
        if not ID.fullmatch(answer):
            shown = f"found {answer!r}" if answer else "is empty"
            found[name] = f"{called}: {shown}; expected letters, digits, - and _ only, for example P07. No real names."
    if not found and entry.participant_a == entry.participant_b:
        found["participant_b"] = f"Participant B: found {entry.participant_b!r} for both; expected two pseudonyms."
    defaults = {name: getattr(Session(), name) for name in ("participant_a", "participant_b")}
    for name, usual in defaults.items():
        if not entry.pilot and getattr(entry, name) == usual:
            found.setdefault(name, f"{ASKED[name]}: {usual!r} is only the default; expected a pseudonym such as P07.")
    if not entry.consent and not entry.pilot:
        found["consent"] = "Consent: not ticked; without consent only a pilot run is possible."
    return found


def stand_in_problem(entry: FormAnswers, said: str, stand_ins: Sequence[str]) -> dict[str, str]:
    """Return a sentence if a real session has stand-ins that the operator's words do not name; else nothing."""
    lacking = [words for words in stand_ins if not names(said, words)]
    if entry.pilot or not lacking:
        return {}
    return {"words": f"Devices: to open a REAL session, write: {', '.join(lacking)}. Otherwise choose PILOT."}


def as_json(entry: FormAnswers) -> str:
    """Return the answers as the argument of the command ``open``."""
    return json.dumps(asdict(entry))
