"""The watch of a robot partner: what its looks tell, and that a partner that hangs ends its process."""

import subprocess
import sys

import pytest

from netboard.nodes.agent.partner_watch import LOOKS, Looks


def looks(found: list[int | None]) -> Looks:
    made = Looks()
    for decision in found:
        made.add(decision)
    return made


@pytest.mark.parametrize(
    ("found", "hangs", "too_slow"),
    [
        ([None] * LOOKS, False, False),
        ([7] * LOOKS, True, True),
        ([7] * (LOOKS - 1), False, False),
        (list(range(LOOKS)), False, True),
        ([*range(LOOKS // 2), *[None] * (LOOKS // 2)], False, False),
        ([None, *[7] * (LOOKS - 1)], False, True),
    ],
    ids=["quick", "hangs", "too early to say", "slow", "half of the time", "hangs since shortly"],
)
def test_looks_tell_a_quick_a_slow_and_a_hanging_partner_apart(
    found: list[int | None], hangs: bool, too_slow: bool
) -> None:
    made = looks(found)
    assert (made.hangs, made.too_slow) == (hangs, too_slow)


HANGING = """
import logging, sys, threading
from netboard.nodes.agent import partner_watch

logging.basicConfig(stream=sys.stdout)
partner_watch.LOOK_SECONDS = 0.001

class Device:
    partner = "mine"
    decision = DECISION
    def let_go(self):
        print("let go", flush=True)
        done.set()

done, device = threading.Event(), Device()
partner_watch.watch(device)
done.wait(60.0)
"""


def watched(decision: str) -> "subprocess.CompletedProcess[str]":
    """Run a process whose partner has this number of its decision."""
    script = HANGING.replace("DECISION", decision)
    return subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=False, timeout=60)


def test_partner_that_hangs_ends_its_process_in_words() -> None:
    run = watched("7")
    assert run.returncode == 1
    assert "the robot partner 'mine' has not finished a decision for 0.04 s: its agent ends" in run.stdout


def test_partner_that_is_too_slow_lets_go() -> None:
    run = watched("property(lambda self, count=[0]: count.append(0) or len(count))")
    assert (run.returncode, run.stdout) == (0, "let go\n")
