"""What displays hear and say: what one participant may see, at most 120 times a second, and what was shown of it.

A message is data only; `netboard.wire.messages` holds the rules for all of them.
"""

from dataclasses import dataclass

MOST_SHOWN = 256
"""Frames in one report: those of a second at 240 Hz, the highest refresh rate that is supported, and some more [1]."""


@dataclass(frozen=True, slots=True)
class View:
    """What one participant may see; nothing else is ever sent to a display.

    Attributes
    ----------
    station : str
        ``left`` or ``right``.
    tick : int
        Tick it shows [1].
    sent_ns : int
        Server time when it was sent [ns].
    phase : str
        Name of the trial's phase (`netboard.experiment.machine.Phase`, lower case), or ``away`` at a station whose
        participant has nothing to do in this block.
    z : float
        Height of the board's centre [m].
    theta : float
        Tilt of the board, + = right end up [rad].
    p : float or None
        Ball position along the board, + = right; None without a ball [m].
    target : float
        Centre of the target along the board [m].
    left, right : float or None
        Height of the left and right stylus; None where the participant may not see it [m].
    trial : int
        Number of the current trial in the block, from 1 [1].
    trials : int
        Successful trials the block asks for [1].
    failures : int
        Failed attempts in the block so far [1].
    completion : float or None
        Completion time of the last successful trial [s].
    best : float or None
        Best completion time of the block so far [s].
    notice : str
        A line for the participant, a word that the display knows a line for (``again``), or empty.
    seq : int
        Number of the view at its station, from 0: what is missing was never shown [1].
    share : float
        How much of the time is over for which the board must be level, or the ball in the target; 0 to 1 [1].
    block, blocks : int
        Number of the block in its plan, from 1, and how many there are [1].
    rest : float or None
        What is left of the rest before the block; None without one [s].
    """

    station: str
    tick: int
    sent_ns: int
    phase: str
    z: float
    theta: float
    p: float | None
    target: float
    left: float | None
    right: float | None
    trial: int
    trials: int
    failures: int
    completion: float | None
    best: float | None
    notice: str
    seq: int
    share: float
    block: int
    blocks: int
    rest: float | None


@dataclass(frozen=True, slots=True)
class Frames:
    """What a display has shown since its last report, display to server on the control channel.

    Attributes
    ----------
    station : str
        ``left`` or ``right``.
    shown : tuple of (int, int, int)
        For each frame: tick of the view, when it was received and when it was painted [1, ns, ns].
    dropped : int
        Refreshes since the start in which a view that had been sent did not come, or a picture that was due was not
        painted [1].
    """

    station: str
    shown: tuple[tuple[int, int, int], ...]
    dropped: int
