"""``netboard status`` names the block and what is pending, and lists refused messages with their counts."""

import math
from dataclasses import replace
from io import StringIO

from rich.console import Console

from fakes import STATUS
from netboard.network.protocol.control import FORM_AWAITED, Status
from netboard.nodes.operator.shell import state_text
from netboard.nodes.operator.status_table import status_tables


def printed(status: Status) -> str:
    console = Console(file=StringIO(), width=80)
    console.print(status_tables(status))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_refusals_are_shown_with_their_counts() -> None:
    status = replace(
        STATUS,
        refused=(
            ("handshake", "its key is not known here", 400),
            ("control", "it has not joined yet", 3),
        ),
    )
    assert "refused so far, 400 times: handshake: its key is not known here" in printed(status)
    assert "refused so far, 3 times: control: it has not joined yet" in printed(status)


def test_status_names_the_block_and_what_is_pending() -> None:
    assert "block 1 of 1: dyadic, force full\n" in printed(STATUS)
    planned = replace(STATUS, block=2, blocks=3, label="duo, mass light", pending="end after this block")
    assert "block 2 of 3: duo, mass light\n" in printed(planned)
    assert "\nend after this block\n" in printed(planned)


def test_answer_to_a_command_says_what_is_missing() -> None:
    assert state_text(STATUS) == "the trial is idle"
    lacking = replace(STATUS, waiting_for=("the logger", "the session's form"))
    assert state_text(lacking) == "the trial is idle; waiting for the logger and the session's form"
    notice = f"2 trials are lost; {FORM_AWAITED}left and right, 57 s at most; the disk is slow"
    asked = replace(STATUS, phase="finished", notice=notice)
    assert state_text(asked) == f"the trial is finished; {FORM_AWAITED}left and right"


def test_status_says_once_what_is_missing() -> None:
    missing = ("the right agent",)
    told = replace(STATUS, waiting_for=missing, notice="waiting for the right agent, the session's form")
    assert printed(told).count("the right agent") == 1
    untold = replace(STATUS, waiting_for=missing, notice="the disk is slow")
    assert "\nwaiting for the right agent\nthe disk is slow\n" in printed(untold)


def test_status_says_how_a_pause_ends_and_lost_trials_are_repeated() -> None:
    assert "to resume: netboard control resume" in printed(replace(STATUS, phase="paused"))
    notice = "2 of 9 trials will be excluded: deadline misses"
    lost = replace(STATUS, phase="finished", blocks=2, notice=notice, lost=(1, 5))
    text = " ".join(printed(lost).split())
    repeat = "to repeat those 2 trials: netboard control repeat_lost"
    assert f"{notice} {repeat}; to continue without: netboard control next" in text
    assert "control end" in printed(replace(lost, block=2))
    assert "repeat_lost" not in printed(replace(lost, notice=""))


def test_status_says_how_to_go_on_without_answers() -> None:
    step = "to go on without the answers: netboard control skip_form"
    assert step not in printed(replace(STATUS, phase="finished"))
    waiting = replace(STATUS, phase="finished", notice=f"{FORM_AWAITED}left, 57 s at most")
    assert step in " ".join(printed(waiting).split())


def test_status_names_the_latency_in_words() -> None:
    loops = (("agent.left", math.nan, 0.007),)
    text = " ".join(printed(replace(STATUS, loops=loops)).split())
    assert "agent.left: sample-to-force latency not measured" in text
    assert "(with no hand on it, the stylus is stable up to 7.00 ms)" in text
