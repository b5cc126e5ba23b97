"""Screens of each phase: the board in a trial, texts before, between and after trials. Pure: no Qt, no clock.

Texts are few and calm; times appear between trials only; every picture of a pilot run carries the pilot label. All
texts come from the `DisplayTexts` of the participant's language, except instructions that a block brings itself.
"""

import math
from dataclasses import replace

from netboard.base.config import Config, Side
from netboard.base.errors import WireError
from netboard.stage.curtain import AGAIN, PAUSE_NOTICES, Pause
from netboard.stage.view import View
from netboard.windows.participant.scene import COLOURS, DisplayPicture, PictureState, extent, with_board
from netboard.windows.participant.trial_events import SUCCEEDED
from netboard.windows.participant.words import DisplayTexts, instructions

_STATES = {
    "idle": PictureState.WAIT,
    "levelling": PictureState.LEVEL,
    "running": PictureState.RUN,
    "holding": PictureState.HOLD,
    "succeeded": PictureState.SUCCESS,
    "failed": PictureState.FAIL,
    "paused": PictureState.PAUSED,
    "finished": PictureState.FINISHED,
    "away": PictureState.WAIT,
}
"""Picture state of each phase."""

NOTICES = (AGAIN, *PAUSE_NOTICES)
"""Notices that a view may carry."""

IN_TRIAL = ("running", "holding")
"""Phases in which the ball is free, and the photodiode patch white."""


def compose(view: View, config: Config, words: DisplayTexts, result: str = "") -> DisplayPicture:
    """Return the picture of a view; `result` is how the last trial ended, while that is still displayed."""
    check(view)
    state = _STATES[view.phase]
    picture = replace(_empty(state, config, words), patch=_patch(config, view.phase in IN_TRIAL))
    match view.phase:
        case "idle":
            return _before(picture, view, config, words)
        case "away":
            return _away(picture, view, words)
        case "finished":
            return _after(picture, view, words)
    picture = replace(picture, counter=words.trial.format(trial=min(view.trial, view.trials), trials=view.trials))
    return with_board(_with_texts(picture, view, config, words, result), view, config)


def check(view: View) -> None:
    """Raise WireError for a view with an unknown phase or notice, or a number that is not finite."""
    if view.phase not in _STATES:
        raise WireError(f"a view in the unknown phase {view.phase!r}")
    if view.notice not in NOTICES:
        raise WireError(f"a view with the unknown notice {view.notice!r}")
    shown = (view.z, view.theta, view.target, view.p, view.left, view.right, view.share)
    times = (view.completion, view.best, view.rest)
    if not all(math.isfinite(number) for number in (*shown, *times) if number is not None):
        raise WireError("a view with a number that is not finite")


def blank(
    config: Config, words: DisplayTexts, headline: str, detail: str = "", *, lost: bool = False, over: bool = False
) -> DisplayPicture:
    """Return a picture with text only: the connection is lost, the session is over, or it has not begun."""
    state = PictureState.LOST if lost else PictureState.FINISHED if over else PictureState.WAIT
    picture = _empty(state, config, words)
    return replace(picture, headline=headline, detail=detail, patch=_patch(config, False))


def _empty(state: PictureState, config: Config, words: DisplayTexts) -> DisplayPicture:
    """Return a picture with no content except the label of a pilot run."""
    return DisplayPicture(state, COLOURS[state], extent(config), pilot=words.pilot if config.session.pilot else "")


def _patch(config: Config, white: bool) -> bool | None:
    """Colour of the photodiode patch: True for white; None without a patch."""
    return white if config.display.patch else None


def _before(picture: DisplayPicture, view: View, config: Config, words: DisplayTexts) -> DisplayPicture:
    """Add the texts before a block: the countdown of a rest, then the instructions."""
    if view.rest is not None and view.rest > 0:
        following = words.next.format(block=view.block, blocks=view.blocks)
        return replace(picture, headline=words.rest, detail=_countdown(view.rest), notice=following)
    side: Side = "left" if view.station == "left" else "right"
    return replace(
        picture,
        headline=words.ready if view.blocks == 1 else words.block.format(block=view.block, blocks=view.blocks),
        text=instructions(config, words, side),
        notice=words.wait,
    )


def _away(picture: DisplayPicture, view: View, words: DisplayTexts) -> DisplayPicture:
    """Add the texts for a participant who does not take part in this block: not the trials, which are the partner's."""
    left = "" if view.rest is None or view.rest <= 0 else _countdown(view.rest)
    block = words.block.format(block=view.block, blocks=view.blocks) if view.blocks > 1 else ""
    return replace(picture, headline=words.away, detail=left or words.away_text, counter=block)


def _after(picture: DisplayPicture, view: View, words: DisplayTexts) -> DisplayPicture:
    """Add the texts after a block."""
    waits = view.notice == PAUSE_NOTICES[Pause.DECISION]
    last = view.block >= view.blocks and not waits
    done = words.finished if last else words.block_done.format(block=view.block, blocks=view.blocks)
    best = "" if view.best is None else words.best.format(time=words.seconds(view.best))
    return replace(
        picture,
        headline=done,
        detail=best[:1].upper() + best[1:],
        notice=_notice(view, words) or ("" if last else words.wait),
    )


def _with_texts(
    picture: DisplayPicture, view: View, config: Config, words: DisplayTexts, result: str
) -> DisplayPicture:
    """Add the texts of a phase within a trial."""
    fell = words.failed if config.task.time_limit > 0 else words.fell
    match view.phase:
        case "levelling" if result:
            well = result == SUCCEEDED
            ended = COLOURS[PictureState.SUCCESS if well else PictureState.FAIL]
            return replace(
                picture,
                colours=replace(picture.colours, headline=ended.headline if well else ended.ball),
                headline=words.succeeded if well else fell,
                detail=_times(view, words) if well else _notice(view, words),
                notice=words.level,
            )
        case "levelling":
            again = _notice(view, words)
            return replace(picture, headline=words.level, detail=_last(view, words), notice=again)
        case "holding":
            return replace(picture, headline=words.hold)
        case "succeeded":
            return replace(picture, headline=words.succeeded, detail=_times(view, words))
        case "failed":
            return replace(picture, headline=fell)
        case "paused":
            return replace(picture, headline=words.paused, detail=_notice(view, words))
    return picture


def _notice(view: View, words: DisplayTexts) -> str:
    """Return the text of a view's notice, which has the same name; empty for none."""
    text: str = getattr(words, view.notice) if view.notice else ""
    return text


def _times(view: View, words: DisplayTexts) -> str:
    """Completion time of the last trial, marked if it is the best one."""
    if view.completion is None:
        return ""
    if view.best is not None and view.completion <= view.best:
        return f"{words.seconds(view.completion)} s   {words.new_best}"
    return _last(view, words)


def _last(view: View, words: DisplayTexts) -> str:
    """Last and best completion time, as the participant reads them."""
    if view.completion is None:
        return ""
    last = words.last.format(time=words.seconds(view.completion))
    best = "" if view.best is None else f"   ({words.best.format(time=words.seconds(view.best))})"
    return last + best


def _countdown(rest: float) -> str:
    """Remaining time of a rest, in minutes and seconds."""
    minutes, seconds = divmod(math.ceil(rest), 60)
    return f"{minutes}:{seconds:02}"
