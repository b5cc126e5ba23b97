"""Infer the trial events between two views, for the participant's texts and the markers. Pure.

A trial is in the phase ``succeeded`` or ``failed`` for one tick, which no view may show. The outcome is inferred from
the counts and completion times of the views around it. So a display can show a result for a while, and mark every event
once, in order.
"""

from dataclasses import dataclass

from netboard.stage.view import View

SHOWN_TICKS = 1500
"""Longest time for which a result is displayed, in ticks of 1 ms [1]."""

NEARLY = 0.9
"""If this share of the hold time was over in the last view, the hold may have been completed since [1]."""

SUCCEEDED, FAILED = "succeeded", "failed"


@dataclass(frozen=True, slots=True)
class TrialEvents:
    """The events up to a view."""

    view: View
    events: tuple[str, ...]  # phases that began since the previous view, in order, whether a view showed them or not
    result: str = ""  # ``succeeded`` or ``failed`` while the result is displayed, else empty
    since: int = 0


def events_after(last: TrialEvents | None, view: View) -> TrialEvents:
    """Return the events after another view; a view of another block or of an earlier tick clears them."""
    if last is None or view.block != last.view.block or view.tick < last.view.tick:
        return TrialEvents(view, (view.phase,))
    before = last.view
    result = _result(before, view)
    begun = view.phase if view.phase != before.phase or result not in ("", view.phase) else ""
    events = tuple(dict.fromkeys(name for name in (result, begun) if name))
    if result:
        return TrialEvents(view, events, result, view.tick)
    over = view.phase not in ("levelling", SUCCEEDED, FAILED) or view.tick - last.since > SHOWN_TICKS
    return TrialEvents(view, events, "" if over else last.result, last.since)


def _result(before: View, view: View) -> str:
    """Return how an attempt ended between two views; empty if none did."""
    if view.phase in (SUCCEEDED, FAILED):
        return view.phase if view.phase != before.phase else ""
    if view.failures > before.failures and before.phase != FAILED:
        return FAILED
    held = before.phase == "holding" and view.phase != "holding"
    timed = view.completion is not None and view.completion != before.completion
    if held and (timed or (view.trial > before.trial and before.share > NEARLY)):
        return SUCCEEDED
    return ""
