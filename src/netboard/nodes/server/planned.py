"""A session that follows a plan: its blocks and its journal, from the beginning or resumed."""

import sys
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from netboard.base.config import Config, digest, resolve
from netboard.base.errors import ConfigError
from netboard.base.tables.experiment import Session
from netboard.base.terminal.output import plain_console
from netboard.nodes.server.attempts import Attempts
from netboard.nodes.server.blocks import BlockSequence
from netboard.nodes.server.pseudonyms import Use, require_own_pseudonyms, uses_in, uses_in_journals
from netboard.recording.recovery.journal_file import Journal, journal_path, other_journals, started_before
from netboard.task.journal.entries import FORMAT, Entry, Header, Opened
from netboard.task.journal.progress import progress_of, resume_words
from netboard.task.journal.same_session import (
    changed_plan,
    changes,
    require_same_people,
    require_same_plan,
    skipped_sessions,
)
from netboard.task.plans import plan as plans
from netboard.task.plans.balance import require_balance
from netboard.task.plans.plan import Plan, PlanSession, config_of, plan_of, seated, shortened
from netboard.task.studies.study import Study, digest_of_study, resolve_study

console = plain_console()

YES = ("y", "yes", "j", "ja", "o", "oui", "s", "si")
"""Answers that confirm."""


@dataclass(frozen=True, slots=True)
class StudySession:
    """A session of a study."""

    study: str
    dyad: int
    session: int = 1
    seed: int = 1
    # For a pilot run: the number of blocks, and the largest number of trials in each.
    blocks: int | None = None
    trials: int | None = None

    @property
    def options(self) -> list[str]:
        """The options with which ``netboard server`` runs this session."""
        numbers = {"dyad": self.dyad, "session": self.session, "seed": self.seed}
        short = {"blocks": self.blocks, "trials": self.trials}
        given = {**numbers, **{name: number for name, number in short.items() if number is not None}}
        return ["--study", self.study, *(word for name, n in given.items() for word in (f"--{name}", str(n)))]


class Planned:
    """One session of a plan on a rig; a plan that has no such session, or does not fit the rig, is a `ConfigError`."""

    def __init__(self, config: Config, study: Study, wanted: StudySession) -> None:
        self.study, self.wanted = study, wanted
        hands = (config.session.hand_a, config.session.hand_b)
        self.plan: Plan = plan_of(self.study, wanted.seed, wanted.dyad, hands)
        require_balance(self.study, self.plan)
        if not 1 <= wanted.session <= len(self.plan.sessions):
            raise ConfigError(
                f"--session: found {wanted.session}, expected 1 to {len(self.plan.sessions)}: the sessions of "
                f"the study {self.study.name}"
            )
        self.session: PlanSession = self.plan.sessions[wanted.session - 1]
        self.config = named(seated(config, self.plan), wanted)
        self.path = self._path(self.config)
        self._recorded: tuple[Use, ...] = ()  # the pseudonyms of other sessions

    def _path(self, config: Config) -> Path:
        return journal_path(Path(config.recording.directory), config)

    def blocks(self, session: Session) -> list[Config]:
        """Return the configuration of each block, for a session with this form; refuse the form of another dyad."""
        planned = self.config.session
        labels = (("dyad", session.dyad, planned.dyad), ("study", session.study, planned.study))
        for name, found, expected in labels:
            if found != expected:
                raise ConfigError(
                    f'the form: [session] {name}: found "{found}", expected "{expected}", whose plan this server runs '
                    f"(--study {self.study.name} --dyad {self.wanted.dyad})"
                )
        if not session.pilot and (self.wanted.blocks or self.wanted.trials):
            raise ConfigError(
                "--blocks, --trials: shorten the plan, which only a pilot run may do; expected [session] pilot = true"
            )
        return self.of_session(session)

    def of_session(self, session: Session) -> list[Config]:
        """Return the configuration of each block, whatever the form says."""
        config = replace(self.config, session=session)
        whole = [config_of(config, self.session, block.number) for block in self.session.blocks]
        return list(shortened(whole, self.wanted.blocks, self.wanted.trials))

    def header(self, session: Session) -> Header:
        """Return the header of the session's journal."""
        config = replace(self.config, session=session)
        return Header(
            format=FORMAT,
            study=self.study.name,
            study_digest=digest_of_study(self.study),
            plan_digest=plans.digest(self.plan, self.wanted.blocks, self.wanted.trials),
            seed=self.wanted.seed,
            dyad=session.dyad,
            name=session.name,
            session=self.wanted.session,
            participants=(session.participant_a, session.participant_b),
            pilot=session.pilot,
            consent=session.consent,
            netboard=version("netboard"),
            config_digest=digest(config),
            config=resolve(config),
            study_text=resolve_study(self.study),
        )

    def begin(self) -> tuple[BlockSequence, Attempts]:
        """Begin the session."""
        if self.path.exists():
            if self.config.session.ready:
                raise started_before(self.path)
            console.print(
                f"{self.path}: already exists: this session was started before. Check --dyad and --session; resume it "
                "with --resume, or enter another name in the form of the new session; otherwise it cannot be opened",
                soft_wrap=True,
            )
        self._recorded = uses_in(self.path.parent)
        require_own_pseudonyms(self.config.session, self._recorded)
        now = self.header(self.config.session)
        others = [header for _, header in other_journals(self.path, now.dyad)]
        warnings = [*filter(None, (*(changed_plan(other, now) for other in others), skipped_sessions(others, now)))]
        for warning in warnings:
            console.print(warning, style="yellow", soft_wrap=True)
        attempts = Attempts(self._new_journal, warning="; ".join(warnings))
        return BlockSequence(self.blocks(self.config.session), self.blocks), attempts

    def _new_journal(self, config: Config) -> Journal:
        """Create the journal of a session whose form is complete."""
        path, header = self._path(config), self.header(config.session)
        for other, others in other_journals(path, header.dyad):
            require_same_people(others, header, str(other))
        require_own_pseudonyms(config.session, (*self._recorded, *uses_in_journals(path.parent)))
        return Journal.create(path, header)

    def resume(self, ask: Callable[[str], bool]) -> tuple[BlockSequence, Attempts]:
        """Resume the session where it was interrupted, if `ask` confirms what it is shown."""
        journal, header, entries, torn = Journal.reopen(self.path)
        try:
            session = form_in(entries, self.config.session, header)
            now = self.header(session)
            require_same_plan(header, now, str(self.path))
            progress = progress_of(header, entries, [config.block for config in self.blocks(session)], str(self.path))
            if progress.complete:
                raise ConfigError(f"{self.path}: {resume_words(progress)}")
            said = [f"{self.path}: {resume_words(progress)}", *changes(header, now)]
            if torn:
                said.append("the last line of the journal is incomplete, and is ignored")
            if not ask("\n".join(said)):
                raise ConfigError("--resume: not confirmed; nothing was started")
        except BaseException:
            journal.close()
            raise
        blocks = self.blocks(session)
        return BlockSequence(blocks, self.blocks, progress.block - 1), Attempts(journal=journal, progress=progress)


def named(config: Config, wanted: StudySession) -> Config:
    """Name dyad and session after their numbers where the configuration does not name them."""
    usual, session = Session(), config.session
    name = f"S{wanted.session:02d}" if session.name == usual.name else session.name
    dyad = f"D{wanted.dyad:02d}" if session.dyad == usual.dyad else session.dyad
    return replace(config, session=replace(session, name=name, dyad=dyad))


def form_in(entries: tuple[Entry, ...], known: Session, header: Header) -> Session:
    """Return the form of a session from its journal."""
    opened = next((entry for entry in entries if isinstance(entry, Opened)), None)
    told = {} if opened is None else opened.form
    words: dict[str, Any] = {field.name: told[field.name] for field in fields(Session) if field.name in told}
    return replace(known, **(words | {"pilot": header.pilot, "consent": header.consent}))


def confirm(yes: bool) -> Callable[[str], bool]:
    """Make a function that shows what will be done and asks for confirmation, unless `yes` gives it."""

    def ask(words: str) -> bool:
        console.print(words, soft_wrap=True)
        if yes:
            return True
        if not sys.stdin.isatty():
            raise ConfigError("--resume: needs a confirmation; add --yes, or run it in a terminal")
        try:
            return input("Resume there? [y/N] ").strip().casefold() in YES
        except EOFError:  # Ctrl-D
            return False

    return ask
