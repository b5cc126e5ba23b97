"""Frames of unregistered peers on the motion channel, which compiled code keeps until there is time for them.

Samples wait behind them in the same socket, so such a frame is set aside at once and handled after the tick.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, kernel
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.messages import KINDS
from netboard.network.transport import fastpath

UNREGISTERED_FRAME_SIZE = 4096
"""Longest frame of an unregistered peer that is kept: that of a `Hello` [bytes]."""

UNREGISTERED_CAPACITY = 16
"""Frames of unregistered peers that are kept at once [1]."""

SENDER_SLOTS = 8192
"""Places for the hashed names of senders; those that share one share its rate [1]."""

UNREGISTERED_INTERVAL_NS = 200_000_000
"""Time for which further frames of an unregistered peer are dropped after one was kept; `Hello` counts apart [ns]."""

_HELLO = next(number for number, kind in KINDS.items() if kind.message is Hello)

UNREGISTERED_FRAME = np.dtype(
    [
        ("size", "<i8"),
        ("name_size", "<i8"),
        ("name", "u1", (fastpath.NAME_ROOM,)),
        ("key", "u1", (fastpath.KEY_SIZE,)),
        ("address", "u1", (fastpath.ADDRESS_ROOM,)),
        ("frame", "u1", (UNREGISTERED_FRAME_SIZE,)),
    ],
    align=True,
)
"""A frame of an unregistered peer, and its sender."""

UNREGISTERED = np.dtype(
    [
        ("kept", "<i8"),
        ("dropped", "<i8"),
        ("ignored_until_ns", "<i8", (SENDER_SLOTS,)),
        ("frames", UNREGISTERED_FRAME, (UNREGISTERED_CAPACITY,)),
    ],
    align=True,
)
"""Frames of unregistered peers: those that are kept, and how many were dropped unread."""


@kernel
def keep(unregistered: Records, fast: Records, frame: NDArray[np.uint8], now_ns: int) -> None:
    """Keep a frame of an unregistered peer for later, or only count it.

    The rate is limited for each name, with `Hello` counted apart from all other messages. A peer that says hello is
    thus received however much others send. A `Hello` that repeats a kept one is no refusal: while the server compiles,
    several of them arrive from each agent.
    """
    path, pool = fast[0], unregistered[0]
    size = path["size"]
    # FNV-1a hash of the name: senders share a fixed number of places, whatever they call themselves.
    place = 2166136261
    for k in range(path["name_size"]):
        place = ((place ^ path["name"][k]) * 16777619) & 0xFFFFFFFF
    says_hello = size > 1 and frame[1] == _HELLO
    place = (2 * place + says_hello) % SENDER_SLOTS
    row = pool["kept"]
    if now_ns < pool["ignored_until_ns"][place]:
        pool["dropped"] += not says_hello
        return
    if row >= UNREGISTERED_CAPACITY or size > UNREGISTERED_FRAME_SIZE:
        pool["dropped"] += 1
        return
    pool["ignored_until_ns"][place] = now_ns + UNREGISTERED_INTERVAL_NS
    kept = pool["frames"][row]
    kept["size"], kept["name_size"] = size, path["name_size"]
    fastpath.copy(kept["name"], path["name"], len(path["name"]))
    fastpath.copy(kept["key"], path["key"], len(path["key"]))
    fastpath.copy(kept["address"], path["address"], len(path["address"]))
    fastpath.copy(kept["frame"], frame, size)
    pool["kept"] = row + 1
