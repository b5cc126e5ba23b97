"""Whether a journal is that of the session that is to go on, and what has changed since it was begun."""

from typing import Any

from netboard.base.errors import RecordingError
from netboard.task.journal.entries import Header


def require_same_plan(header: Header, now: Header, source: str) -> None:
    """Refuse to go on with another plan, or for others, than a journal was begun with.

    Parameters
    ----------
    header : Header
        The journal's.
    now : Header
        What a journal would begin with that is made now.
    source : str
        The journal's name, for error messages.

    Raises
    ------
    RecordingError
        If they differ in what makes the plan; the message has a line for every difference.
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
        problems.append("the text of the study has changed since")
    elif not problems and header.plan_digest != now.plan_digest:
        problems.append("the same study makes another plan now: this netboard orders blocks in another way")
    if problems:
        raise RecordingError("\n".join(f"{source}: cannot be resumed: {problem}" for problem in problems))


def changes(header: Header, now: Header) -> tuple[str, ...]:
    """What has changed since a journal was begun and keeps nobody from going on, for the operator.

    Parameters
    ----------
    header, now : Header
        As for `require_same_plan`.

    Returns
    -------
    tuple of str
        A sentence for each.
    """
    found = _differences(header, now, {"netboard": "version of netboard", "consent": "consent"})
    if header.config_digest != now.config_digest:
        found.append("the rig's configuration has changed since")
    return tuple(found)


def _differences(header: Header, now: Header, words: dict[str, str]) -> list[str]:
    """Say in which fields two headers differ."""
    both = [(word, getattr(header, name), getattr(now, name)) for name, word in words.items()]
    return [
        f"{word}: it was begun with {_said(then)}, and this is {_said(new)}" for word, then, new in both if then != new
    ]


def _said(value: Any) -> str:
    match value:
        case bool():
            return "yes" if value else "no"
        case tuple():
            return " and ".join(map(str, value))
        case _:
            return str(value)
