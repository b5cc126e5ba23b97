"""Perturbation trials: a known force pushes the ball, the board or a stylus for a short time.

`Perturbation` is the table ``[perturbation]`` of a block: where the force acts, when it begins, how long and how strong
it is, and in which trials. `PLACES` has one entry for each place at which it can act; the kernels of
`netboard.stage.perturbing` and the texts of the documentation follow from them.
"""

from dataclasses import dataclass
from typing import Annotated, Literal, get_args

from pydantic import StrictInt

from netboard.base.settings import FORBID_UNKNOWN_KEYS, about

MAX_PERTURBED = 1000
"""Most perturbation trials in a block [1]."""

Place = Literal["none", "ball", "board", "left", "right"]
"""Where the force of a perturbation acts; the number in kernels is its place."""

PLACES: dict[Place, str] = {
    "none": "nowhere: there are no perturbation trials",
    "ball": "at the centre of the ball, along the board; + = towards the target",
    "board": "at the centre of the board; + = up",
    "left": "at the left stylus, added to the commanded force before its delay and the safety chain; + = up",
    "right": "at the right stylus, likewise",
}
"""Where the force acts, and its positive direction, for the documentation."""

if tuple(PLACES) != get_args(Place):
    raise RuntimeError(f"PLACES: found {', '.join(PLACES)}, expected {', '.join(get_args(Place))}")

Onset = Literal["time", "ball"]
"""What begins a perturbation: the time since the release, or the ball's position; the number is its place."""

ONSETS: tuple[Onset, ...] = get_args(Onset)
"""The same as a tuple."""


@dataclass(frozen=True, slots=True)
class Perturbation:
    """A known force in some trials of a block, for experiments with perturbations."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    at: Annotated[
        Place, about('where the force acts: "ball", "board", "left" or "right" (a stylus), or "none": no perturbation')
    ] = "none"
    force: Annotated[
        float, about("force; + = towards the target for the ball, up for board and styluses", "N", ge=-20, le=20)
    ] = 0.05
    duration: Annotated[float, about("how long the force acts", "s", ge=0.001, le=10)] = 0.1
    onset: Annotated[
        Onset,
        about('"time": it begins some time after the release; "ball": when the ball first passes a position'),
    ] = "time"
    time: Annotated[float, about('time after the release, with onset = "time"', "s", ge=0, le=60)] = 0.5
    position: Annotated[
        float, about('position of the ball, + = on the target\'s side, with onset = "ball"', "m", ge=-1, le=1)
    ] = 0.0
    trials: Annotated[
        tuple[StrictInt, ...], about("numbers of the perturbation trials", max_length=MAX_PERTURBED, strict=False)
    ] = ()
    opposite: Annotated[
        tuple[StrictInt, ...],
        about("those of them whose force has the opposite sign", max_length=MAX_PERTURBED, strict=False),
    ] = ()

    def force_in(self, trial: int) -> float:
        """Return the force in a trial with its sign, 0 if it is no perturbation trial [N].

        Parameters
        ----------
        trial : int
            Number of the trial in the block, from 1; 0 before the first [1].
        """
        if self.at == "none" or trial not in self.trials:
            return 0.0
        return -self.force if trial in self.opposite else self.force
