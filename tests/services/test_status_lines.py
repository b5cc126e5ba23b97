"""``netboard status`` names the block and what is pending, and lists refused messages with their counts."""

from dataclasses import replace
from io import StringIO

from rich.console import Console

from fakes import STATUS
from netboard.network.protocol.control import Status
from netboard.nodes.operator.shell import state_text
from netboard.nodes.operator.status_table import status_tables


def printed(status: Status) -> str:
    console = Console(file=StringIO(), width=80)
    console.print(status_tables(status))
    assert isinstance(console.file, StringIO)
    return console.file.getvalue()


def test_refusals_are_shown_with_their_counts() -> None:
    status = replace(
        STATUS, refused=(("handshake", "its key is not known here", 400), ("control", "say hello first", 3))
    )
    assert "refused so far, 400 times: handshake: its key is not known here" in printed(status)
    assert "refused so far, 3 times: control: say hello first" in printed(status)


def test_status_names_the_block_and_what_is_pending() -> None:
    assert "block 1 of 1: dyadic, force full\n" in printed(STATUS)
    planned = replace(STATUS, block=2, blocks=3, label="duo, mass light", pending="end after this block")
    assert "block 2 of 3: duo, mass light\n" in printed(planned)
    assert "\nend after this block\n" in printed(planned)


def test_answer_to_a_command_says_what_is_missing() -> None:
    assert state_text(STATUS) == "the trial is idle"
    lacking = replace(STATUS, waiting_for=("the logger", "the session's form"))
    assert state_text(lacking) == "the trial is idle; waiting for the logger, the session's form"


def test_status_says_once_what_is_missing() -> None:
    missing = ("the right agent",)
    told = replace(STATUS, waiting_for=missing, notice="waiting for the right agent, the session's form")
    assert printed(told).count("the right agent") == 1
    untold = replace(STATUS, waiting_for=missing, notice="the disk is slow")
    assert "\nwaiting for the right agent\nthe disk is slow\n" in printed(untold)
