"""A policy: the controller of a hand that no person moves.

The same policy can run in an agent, in the server as a robot partner, and in a rehearsal. At its own interval it
receives the display and the force of its seat, and returns submovements. Its identity is recorded, so that the
behaviour of a partner can be reproduced.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from typing import Protocol

from netboard.base.tables.simulated import Participant
from netboard.participants.senses import Glimpse
from netboard.participants.submovement import Submovement

SIMULATED_PARTICIPANT = "simulated participant"
"""Kind of the policy of a `netboard.participants.controller.Controller`."""


class Policy(Protocol):
    """Controller of one hand, or of both hands in a bimanual block."""

    @property
    def interval(self) -> float:
        """Time between two decisions [s]."""

    @property
    def identity(self) -> Mapping[str, str]:
        """Kind and parameters as a recording stores them; see `identity_of`."""

    def decide(self, now: float, glimpse: Glimpse | None, felt: float | None) -> tuple[Submovement, ...]:
        """Take in display and force, and return new submovements; empty most of the time."""


def identity_of(kind: str, parameters: Participant | None = None) -> dict[str, str]:
    """Return the identity of a policy, as recorded.

    Parameters
    ----------
    kind : str
        Kind of policy, such as `SIMULATED_PARTICIPANT`.
    parameters : Participant or None
        Parameters of a simulated participant; None for a policy without any.

    Returns
    -------
    dict of str
        ``policy``: the kind. With parameters also ``policy_parameters``, as JSON with sorted names, and
        ``policy_sha256``, the SHA-256 of that text.
    """
    if parameters is None:
        return {"policy": kind}
    text = json.dumps(asdict(parameters), sort_keys=True)
    return {"policy": kind, "policy_sha256": hashlib.sha256(text.encode()).hexdigest(), "policy_parameters": text}
