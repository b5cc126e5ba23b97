"""Policies: what holds a stylus in place of a person. A simulated participant is one, a robot partner another.

A policy gets an `OBSERVATION` and writes an `ACTION` for each of its hands. It sees what the curtain lets its seat see,
as late as the server shows it, and its own stylus and force. More, the true state of the scene, it sees only if it says
so, which is recorded.

Rule 1: what a policy does depends on its constants, its state and its observations, so that each host gets the same
bits: the agent that renders forces, a rehearsal, and an environment.
Rule 2: ``identity`` is recorded, so that the behaviour of a partner can be reproduced.
"""

import hashlib
import json
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import asdict
from typing import Any, ClassVar, TypeVar, final

import numpy as np
from numpy.typing import NDArray

from netboard.base import settings
from netboard.base.compiled import inlined
from netboard.base.config import Config, Side
from netboard.participants.body.stylus import HandMechanics

SEEN = np.dtype([(name, "<f8") for name in ("time", "phase", "z", "theta", "p", "target", "left", "right")])
"""What a station's display shows, as kernels see it: NaN for what is not shown, and for the time before the first view.
The phase is the number of a `netboard.task.trials.state_machine.Phase`, or `netboard.stage.curtain.NO_PHASE`."""

TRUTH = np.dtype(
    [(name, "<f8") for name in ("z", "vz", "theta", "omega", "p", "vp", "left_z", "left_vz", "right_z", "right_vz")]
)
"""True state of board, ball and both styluses [SI]."""

OBSERVATION = np.dtype(
    [
        ("tick", "<i8"),  # number of the update: -1 before the first tick
        ("time", "<f8"),  # time of the observation [s]
        ("start", "<f8"),  # time from which the action applies [s]
        ("seen", SEEN),  # newest view of its own display
        ("height", "<f8", (2,)),  # true height of each own stylus; 0 for one that is not held [m]
        ("z", "<f8", (2,)),  # height of each of its styluses as its encoder reads it [m]
        ("vz", "<f8", (2,)),  # its velocity [m/s]
        ("force", "<f8", (2,)),  # vertical motor force on each own hand, + = up [N]
        ("felt", "<f8"),  # vertical force of the board on the one own hand; NaN where the force is another one [N]
        ("truth", TRUTH),  # NaN, unless the policy declares that it sees it
    ]
)
"""What a policy knows at an update, by side: 0 left, 1 right."""

Decide = Callable[[Any, Any, Any, Any], None]
"""A kernel ``decide(state, constants, observation, actions)``: records of the policy's own types and of `OBSERVATION`,
and an array of two `ACTION`, by side, of which it writes those of its hands."""


_P = TypeVar("_P")


def parameters_of(cls: type[_P], config: Config, side: Side) -> _P:
    """Return the parameters of a robot partner, ``[partners.<side>]`` in the configuration.

    Parameters
    ----------
    cls : type
        Frozen dataclass whose fields are annotated with `netboard.base.settings.about`.
    config : Config
        The configuration of the block.

    Raises
    ------
    ConfigError
        If a parameter is unknown, has the wrong type or is out of range.
    """
    return settings.check(cls, dict(config.partners.of(side)), ("partners", side))


class Policy(ABC):
    """What holds one stylus or both in a block, with its parameters.

    Attributes
    ----------
    kind : str
        What it is, as recorded.
    sees_truth : bool
        Whether it sees the true state of the scene, which no participant does.
    checked : bool
        Whether it lets go of the stylus where its action is not a number; not needed where no observation can cause it.
    decide : callable
        Its kernel, from `netboard.base.compiled.inlined`; see `Decide`. It is called every millisecond, and decides as
        often as it needs to.
    sides : tuple of str
        The hands that it moves.
    constants : ndarray, shape (1,)
        Its constants, packed for the kernel.
    """

    kind: ClassVar[str]
    sees_truth: ClassVar[bool] = False
    checked: ClassVar[bool] = True
    decide: ClassVar["staticmethod[[Any, Any, Any, Any], None]"]
    sides: tuple[Side, ...]
    constants: NDArray[Any]

    @abstractmethod
    def initial(self, seed: tuple[int, ...]) -> NDArray[Any]:
        """Return its state at the start of a block, packed for the kernel: ndarray, shape (1,) [SI].

        Parameters
        ----------
        seed : tuple of int
            Seed of all that is random in it [1].
        """

    @abstractmethod
    def hand(self) -> HandMechanics:
        """Return what each of its hands adds to the mechanics of a device."""

    def across(self, state: NDArray[Any], side: Side) -> tuple[float, float]:
        """Return where a hand is at the start, x and y: across the vertical line [m].

        Parameters
        ----------
        state : ndarray, shape (1,)
            Its state, from `initial` [SI].
        side : {"left", "right"}
            Which of its hands, one of `sides`.
        """
        return 0.0, 0.0

    @property
    @abstractmethod
    def identity(self) -> Mapping[str, str]:
        """What is recorded of it, from `identity_of`."""


@inlined
def _do_nothing(state: np.void, constants: np.void, observation: np.void, actions: NDArray[Any]) -> None:
    """Move no hand."""


@final
class Nobody(Policy):
    """The policy of a seat that nobody takes."""

    kind = "nobody"
    decide = staticmethod(_do_nothing)
    sides = ()
    constants = np.zeros(1)

    def initial(self, seed: tuple[int, ...]) -> NDArray[Any]:
        """Return a state without content [1].

        Parameters
        ----------
        seed : tuple of int
            Not used [1].
        """
        return np.zeros(1)

    def hand(self) -> HandMechanics:
        """Return a hand that adds nothing."""
        return HandMechanics()

    @property
    def identity(self) -> dict[str, str]:
        """What is recorded of it."""
        return identity_of(self.kind)


SIMULATED_PARTICIPANT = "simulated participant"
"""Kind of the policy of a `netboard.participants.people.person.ParticipantPolicy`."""


def identity_of(kind: str, parameters: Any = None, **more: str) -> dict[str, str]:
    """Return the identity of a policy, as recorded.

    Parameters
    ----------
    kind : str
        Kind of policy, such as `SIMULATED_PARTICIPANT`.
    parameters : dataclass or None
        Parameters of the policy; None for one without any.
    **more : str
        What is recorded among the parameters, such as the SHA-256 of a file that one of them names.

    Returns
    -------
    dict of str
        ``policy``: the kind. With parameters also ``policy_parameters``, as JSON with sorted names, and
        ``policy_sha256``, the SHA-256 of that text.
    """
    if parameters is None:
        return {"policy": kind}
    text = json.dumps(asdict(parameters) | more, sort_keys=True)
    return {"policy": kind, "policy_sha256": hashlib.sha256(text.encode()).hexdigest(), "policy_parameters": text}
