"""Identity of a policy: which program moves a hand in place of a person, and with which parameters.

It is recorded, so that the behaviour of a partner can be reproduced. The same policy has the same identity in an agent,
in the server as a robot partner, and in a rehearsal.
"""

import hashlib
import json
from dataclasses import asdict

from netboard.base.tables.simulated import Participant

SIMULATED_PARTICIPANT = "simulated participant"
"""Kind of the policy of a `netboard.participants.people.controller.Controller`."""


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
