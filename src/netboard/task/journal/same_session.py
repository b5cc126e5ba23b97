"""Compare a session with the journal that it resumes, and with the other sessions of its dyad."""

from collections.abc import Iterator, Sequence
from typing import Any

from netboard.base.errors import RecordingError
from netboard.base.settings import parse_toml
from netboard.task.journal.entries import Header


def require_same_plan(header: Header, now: Header, source: str) -> None:
    """Refuse to resume a journal with another plan or other participants.

    Raises
    ------
    RecordingError
        If the headers differ in session, plan or participants; the message has one line per difference.
    """
    words = {
        "dyad": "dyad",
        "name": "session",
        "session": "number of the session",
        "study": "study",
        "seed": "seed",
        "participants": "participants",
        "pilot": "pilot run",
    }
    problems = _differences(header, now, words)
    if header.study_digest != now.study_digest:
        problems.append("the text of the study has changed")
    elif not problems and header.plan_digest != now.plan_digest:
        problems.append(
            "the same study now gives another plan; expected the same --blocks and --trials, the same dominant hands "
            f"([session] hand_a, hand_b), and netboard {header.netboard}"
        )
    if problems:
        raise RecordingError("\n".join(f"{source}: cannot be resumed: {problem}" for problem in problems))


def changes(header: Header, now: Header) -> tuple[str, ...]:
    """List changes since a journal began that do not prevent resuming it, one sentence each, for the operator."""
    found = _differences(header, now, {"netboard": "version of netboard", "consent": "consent"})
    if header.config_digest != now.config_digest:
        found += _changed_settings(header, now) or ["the rig's configuration has changed"]
    return tuple(found)


def _changed_settings(header: Header, today: Header) -> list[str]:
    """Describe the settings that two rigs' configurations have differently; none if a journal lacks its own."""
    then, new = (dict(_settings(parse_toml(one.config, "its configuration"))) for one in (header, today))
    if not then:
        return []
    both = [(key, then.get(key, "none"), new.get(key, "none")) for key in {**then, **new}]
    return [f"{key}: {_text(was)} when the session began, {_text(now)} now" for key, was, now in both if was != now]


def _settings(table: dict[str, Any], path: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted key and the value of each setting."""
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _settings(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def require_same_people(header: Header, now: Header, source: str) -> None:
    """Refuse other participants than in another session of the dyad; a pilot may have any."""
    if header.pilot or now.pilot or header.participants == now.participants:
        return
    raise RecordingError(
        f"participants: {_text(now.participants)}, but {_text(header.participants)} in session {header.name} of dyad "
        f"{header.dyad}; expected the same ones. For a dyad that replaces another, first move {source} away"
    )


def changed_plan(header: Header, now: Header) -> str:
    """Say how the plan differs from that of another session of the dyad, in a sentence; empty if it does not."""
    if header.pilot or now.pilot or header.plan_digest == now.plan_digest:
        return ""
    found = _differences(header, now, {"study": "study", "seed": "seed"}, f"in session {header.name}")
    if header.study_digest != now.study_digest:
        found.append("the text of the study has changed")
    why = "; ".join(found) or "check --dyad, --blocks, --trials, and the dominant hands ([session] hand_a, hand_b)"
    return f"this is not the plan of session {header.name} of dyad {header.dyad}: {why}"


def skipped_sessions(others: Sequence[Header], now: Header) -> str:
    """Say which earlier sessions of the dyad have no journal beside this one, in a sentence; empty for a pilot.

    Parameters
    ----------
    others : sequence of Header
        First lines of the dyad's other journals.
    """
    begun = {other.session for other in others if not other.pilot and other.study == now.study}
    skipped = [str(number) for number in range(1, now.session) if number not in begun]
    if now.pilot or not skipped:
        return ""
    return (
        f"session {now.session} of dyad {now.dyad} begins, but no journal here is of session {' or '.join(skipped)}: "
        "check --dyad and --session"
    )


def _differences(header: Header, now: Header, words: dict[str, str], when: str = "when the session began") -> list[str]:
    """Describe the fields in which two headers differ."""
    both = [(word, getattr(header, name), getattr(now, name)) for name, word in words.items()]
    return [f"{word}: {_text(then)} {when}, {_text(new)} now" for word, then, new in both if then != new]


def _text(value: object) -> str:
    match value:
        case bool():
            return "yes" if value else "no"
        case tuple():
            return " and ".join(map(str, value))
        case _:
            return str(value)
