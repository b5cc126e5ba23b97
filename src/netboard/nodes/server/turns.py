"""The turns of the sessions of a server: it sleeps until one of them has something to do.

A server of many dyads wakes ten times a millisecond, so this is compiled: Python's own `select` takes longer than the
ticks that follow it.
"""

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import Records, machine_code, waiting
from netboard.network.transport import fastpath
from netboard.network.transport.waiting import await_file, forget_files, has_signalled, sleep_until_signalled

MOTION, CONTROL, DUE = 1, 2, 4
"""Bits of why a session has its turn: a message on one of its channels, or its time has come."""

_WAKE, _MOTION_FILE, _CONTROL_FILE, _FOUND = range(4)


@waiting
def _wait(fast: Records, turns: NDArray[np.int64], longest_ns: int) -> None:
    """Sleep until a session has something to do, or for the longest time [ns], and note for each what it is."""
    begun_ns = fastpath.now_ns(fast)
    wake_ns = begun_ns + longest_ns
    forget_files(fast)
    for turn in turns:
        wake_ns = min(wake_ns, turn[_WAKE])
        await_file(fast, turn[_MOTION_FILE])
        await_file(fast, turn[_CONTROL_FILE])
    if wake_ns > begun_ns or len(turns) > 1:  # a session that is alone waits for its sockets itself
        sleep_until_signalled(fast, max(wake_ns - begun_ns, 0))
    else:
        forget_files(fast)
    now_ns = fastpath.now_ns(fast)
    for turn in turns:
        motion = has_signalled(fast, turn[_MOTION_FILE])
        control = has_signalled(fast, turn[_CONTROL_FILE])
        turn[_FOUND] = MOTION * motion + CONTROL * control + DUE * (now_ns >= turn[_WAKE])


class Turns:
    """When each of some sessions wants to run, and the files of its two sockets; `waiting.NO_FILE` for none.

    The files must be below `waiting.FILES` there on POSIX.
    """

    def __init__(self, count: int) -> None:
        self._turns, self._fast = np.zeros((count, 4), np.int64), fastpath.FastPath(None).record
        self._words, self._found = self._turns.data, self._turns[:, _FOUND].data
        self._wait = machine_code(_wait, self._fast, self._turns, 0)

    def plan(self, place: int, wake_ns: int, motion: int, control: int) -> None:
        """Set when a session wants to run if no message arrives first [ns], and the files that signal one."""
        words = self._words
        words[place, _WAKE], words[place, _MOTION_FILE], words[place, _CONTROL_FILE] = wake_ns, motion, control

    def wait(self, longest_ns: int) -> list[int]:
        """Sleep until a session has something to do, or for the longest time [ns].

        Returns for each session the sum of `MOTION`, `CONTROL` and `DUE`; 0 if it has nothing to do.
        """
        self._wait(self._fast, self._turns, longest_ns)
        return self._found.tolist()
