"""What one participant may see of a tick, as data: made by `netboard.stage.curtain`, sent to a display."""

from dataclasses import dataclass


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
        Name of the trial's phase (`netboard.task.trials.state_machine.Phase`, lower case), or ``away`` at a station
        whose participant has nothing to do in this block.
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
        Number of successful trials that the block requires [1].
    failures : int
        Failed attempts in the block so far [1].
    completion : float or None
        Completion time of the last successful trial [s].
    best : float or None
        Best completion time of the block so far [s].
    notice : str
        A text for the participant, a keyword for which the display has a text (``again``), or empty.
    seq : int
        Number of the view at its station, from 0; missing numbers were never shown [1].
    share : float
        Elapsed share of the time for which the board must be level, or the ball in the target; 0 to 1 [1].
    block, blocks : int
        Number of the block in its plan, from 1, and number of blocks [1].
    rest : float or None
        Remaining rest before the block; None without one [s].
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
