"""A server sleeps until one of its sessions has a message, or its time has come."""

import os
from collections.abc import Iterator

import pytest

from netboard.base.clock import now_ns
from netboard.network.transport.waiting import NO_FILE
from netboard.nodes.server.turns import CONTROL, DUE, MOTION, Turns

FAR_NS = 2**60
SHORT_NS, LONG_NS = 2_000_000, 10_000_000_000

Pipes = list[tuple[int, int]]
"""Ends of pipes, to read and to write."""


@pytest.fixture
def pipes() -> Iterator[Pipes]:
    """Stand for the files of two sessions' sockets: motion and control of the first, then of the second."""
    made = [os.pipe() for _ in range(4)]
    yield made
    for ends in made:
        for end in ends:
            os.close(end)


def turns_of(pipes: Pipes, *wakes_ns: int) -> Turns:
    files = [end for end, _ in pipes]
    turns = Turns(len(wakes_ns))
    for place, wake_ns in enumerate(wakes_ns):
        turns.plan(place, wake_ns, *files[2 * place : 2 * place + 2])
    return turns


def test_a_message_gives_its_session_a_turn_at_once(pipes: Pipes) -> None:
    turns = turns_of(pipes, FAR_NS, FAR_NS)
    os.write(pipes[2][1], b"sample")
    assert turns.wait(LONG_NS) == [0, MOTION]
    os.write(pipes[1][1], b"request")
    os.write(pipes[3][1], b"request")
    assert turns.wait(LONG_NS) == [CONTROL, MOTION + CONTROL]
    os.read(pipes[2][0], 16)
    assert turns.wait(LONG_NS) == [CONTROL, CONTROL]


def test_a_session_whose_time_has_come_has_a_turn(pipes: Pipes) -> None:
    due_ns = now_ns() + SHORT_NS
    turns = turns_of(pipes, due_ns, FAR_NS)
    assert turns.wait(LONG_NS) == [DUE, 0]
    assert now_ns() >= due_ns
    assert turns.wait(LONG_NS) == [DUE, 0]  # until it wants to run later
    os.write(pipes[0][1], b"sample")
    os.write(pipes[2][1], b"sample")
    assert turns.wait(LONG_NS) == [DUE + MOTION, MOTION]
    turns.plan(0, FAR_NS, pipes[0][0], pipes[1][0])
    assert turns.wait(LONG_NS) == [MOTION, MOTION]


def test_nobody_has_a_turn_after_the_longest_sleep(pipes: Pipes) -> None:
    begun_ns = now_ns()
    assert turns_of(pipes, FAR_NS, FAR_NS).wait(SHORT_NS) == [0, 0]
    assert now_ns() - begun_ns >= SHORT_NS


def test_a_session_alone_that_waits_for_its_sockets_itself_has_turns_by_time_only(pipes: Pipes) -> None:
    os.write(pipes[0][1], b"sample")
    assert turns_of(pipes, 0).wait(LONG_NS) == [DUE]
    assert turns_of(pipes, FAR_NS).wait(LONG_NS) == [MOTION]


def test_an_ending_session_waits_for_no_file(pipes: Pipes) -> None:
    for _, end in pipes:
        os.write(end, b"message")
    turns = Turns(2)
    turns.plan(0, FAR_NS, NO_FILE, NO_FILE)
    turns.plan(1, FAR_NS, pipes[2][0], pipes[3][0])
    assert turns.wait(LONG_NS) == [0, MOTION + CONTROL]
    turns = Turns(1)
    turns.plan(0, FAR_NS, NO_FILE, NO_FILE)
    assert turns.wait(SHORT_NS) == [0]
