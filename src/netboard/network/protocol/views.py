"""Messages of displays: which views they have painted, and what participants have answered.

The server sends a display a `netboard.stage.view.View` whenever what it shows has changed, at ``network.view_rate_hz``
at most.

A message is data only; `netboard.network.protocol.messages` holds the rules for all of them.
"""

from dataclasses import dataclass

MAX_SHOWN = 256
"""Frames in one report: those of a second at 240 Hz, the highest supported refresh rate, with some margin [1]."""


@dataclass(frozen=True, slots=True)
class Frames:
    """Frames that a display has painted since its last report, display to server on the control channel.

    Attributes
    ----------
    station : str
        ``left`` or ``right``.
    shown : tuple of (int, int, int)
        For each frame: tick of the view, when it was received and when it was painted [1, ns, ns].
    dropped : int
        Refreshes since the start in which a view that had been sent did not arrive, or a picture that was due was not
        painted [1].
    """

    station: str
    shown: tuple[tuple[int, int, int], ...]
    dropped: int


@dataclass(frozen=True, slots=True)
class QuestionnaireAnswers:
    """A participant's answers to the form of a block, display to server on the control channel.

    A display sends it when the participant has finished the form, or when the form closes because the session goes on.

    Attributes
    ----------
    station : str
        ``left`` or ``right``.
    block : int
        Number of the block that the form belongs to, from 1 [1].
    given : dict of str
        Answer to each question by its id, ``QUESTIONNAIRE.NAME``; empty: skipped.
    seconds : float
        How long the form was open [s].
    complete : bool
        Whether the participant finished the form.
    """

    station: str
    block: int
    given: dict[str, str]
    seconds: float
    complete: bool
