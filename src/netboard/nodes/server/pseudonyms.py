"""Pseudonyms of a real session: each belongs to one dyad, and is no default.

Data of two people under one pseudonym could not be told apart later. The journals and recordings in the folder of the
session tell who has had which pseudonym. Pilots may have any.
"""

import json
import logging
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import NamedTuple

from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.experiment import Session
from netboard.recording.files.locate import files_below
from netboard.recording.files.reader import Recording
from netboard.recording.recovery.journal_file import ENDING
from netboard.task.journal.entries import read_lines

log = logging.getLogger(__name__)

FIELDS = ("participant_a", "participant_b")


class Use(NamedTuple):
    """A pseudonym in a real session."""

    pseudonym: str
    dyad: str
    session: str
    date: str  # when the session was opened, UTC
    source: Path


def require_own_pseudonyms(session: Session, uses: Collection[Use]) -> None:
    """Raise an error if a real session has a default pseudonym, one for both, or one that another dyad has.

    ``uses``: the pseudonyms of earlier sessions.
    """
    if not session.real:
        return
    require_given_pseudonyms(session)
    for name in FIELDS:
        own = getattr(session, name)
        other = next((use for use in uses if use.dyad != session.dyad and _same(use.pseudonym, own)), None)
        if other is not None:
            raise ConfigError(
                f'{name}: found "{own}", which dyad {other.dyad} has in session {other.session} of {other.date} '
                f"({other.source}); expected a pseudonym that no other dyad has"
            )


def require_given_pseudonyms(session: Session) -> None:
    """Raise an error if a real session has a default pseudonym, or the same one for both participants."""
    if not session.real:
        return
    usual = Session()
    for name in FIELDS:
        if getattr(session, name) == getattr(usual, name):
            raise ConfigError(
                f'{name}: found "{getattr(session, name)}", the default, which says nothing about who it is; expected '
                "a pseudonym such as P07, or a pilot run"
            )
    if _same(session.participant_a, session.participant_b):
        raise ConfigError(f'participant_b: found "{session.participant_b}" for both; expected two pseudonyms')


def uses_in(folder: Path) -> tuple[Use, ...]:
    """Return the pseudonyms of all real sessions whose journals or recordings are in a folder."""
    if not folder.is_dir():
        return ()
    journals = tuple(uses_in_journals(folder))
    known = {(use.dyad, use.session) for use in journals}
    return (*journals, *(use for path in files_below(folder, (".mcap",)) for use in _in_recording(path, known)))


def uses_in_journals(folder: Path) -> Iterator[Use]:
    """Yield the pseudonyms of all real sessions whose journals are in a folder."""
    for path in files_below(folder, (ENDING,)) if folder.is_dir() else ():
        try:
            with path.open("rb") as file:
                line = file.readline()
            header, opened = read_lines(line, str(path)).header, json.loads(line).get("at", "")
        except (OSError, RecordingError) as error:
            log.warning("its pseudonyms are unknown: %s", error)
            continue
        if header.consent and not header.pilot:
            for pseudonym in header.participants:
                yield Use(pseudonym, header.dyad, header.name, opened[:10], path)


def _in_recording(path: Path, known: Collection[tuple[str, str]]) -> Iterator[Use]:
    """Yield the pseudonyms of a recording, unless its session is known already or not real."""
    try:
        with Recording(path) as recording:
            metadata = recording.metadata
            if metadata.get("pilot") == "true" or (metadata.get("dyad", ""), metadata.get("name", "")) in known:
                return
            session = recording.config.session
    except (OSError, RecordingError, ConfigError) as error:
        log.warning("its pseudonyms are unknown: %s", error)
        return
    if session.real:
        for name in FIELDS:
            yield Use(getattr(session, name), session.dyad, session.name, metadata.get("opened_utc", "?")[:10], path)


def _same(one: str, other: str) -> bool:
    """Return whether two pseudonyms differ in nothing but the case of their letters."""
    return one.casefold() == other.casefold()
