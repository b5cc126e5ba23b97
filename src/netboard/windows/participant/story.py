"""What has happened between the views, as a participant should be told and an amplifier be marked. Pure.

A trial succeeds or fails for one tick, which no view need show. What it was is seen from the views around it: their
counts and completion times. So a display can say "well done" for a while, and mark every event once, in order.
"""

from dataclasses import dataclass

from netboard.stage.view import View

TOLD_TICKS = 1500
"""A result is told for so long at the most: [1] ticks of 1 ms."""

NEARLY = 0.9
"""Who has held this share of the time when last seen may have held all of it [1]."""

SUCCEEDED, FAILED = "succeeded", "failed"


@dataclass(frozen=True, slots=True)
class Story:
    """What has happened up to a view.

    Attributes
    ----------
    events : tuple of str
        The phases that began since the view before, in order, whether they were shown or not.
    result : str
        ``succeeded`` or ``failed`` while that is to be told, else empty.
    """

    view: View
    events: tuple[str, ...]
    result: str = ""
    since: int = 0


def follow(story: Story | None, view: View) -> Story:
    """Go on to a view.

    Returns
    -------
    Story
        What is now. A view of another block, or of an earlier tick, begins a new story.
    """
    if story is None or view.block != story.view.block or view.tick < story.view.tick:
        return Story(view, (view.phase,))
    before = story.view
    result = _result(before, view)
    begun = view.phase if view.phase != before.phase or result not in ("", view.phase) else ""
    events = tuple(dict.fromkeys(name for name in (result, begun) if name))
    if result:
        return Story(view, events, result, view.tick)
    over = view.phase not in ("levelling", SUCCEEDED, FAILED) or view.tick - story.since > TOLD_TICKS
    return Story(view, events, "" if over else story.result, story.since)


def _result(before: View, view: View) -> str:
    """How an attempt ended between two views, or nothing."""
    if view.phase in (SUCCEEDED, FAILED):
        return view.phase if view.phase != before.phase else ""
    if view.failures > before.failures and before.phase != FAILED:
        return FAILED
    held = before.phase == "holding" and view.phase != "holding"
    timed = view.completion is not None and view.completion != before.completion
    if held and (timed or (view.trial > before.trial and before.share > NEARLY)):
        return SUCCEEDED
    return ""
