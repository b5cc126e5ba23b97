"""``netboard status`` lists refused messages with their counts."""

from dataclasses import replace
from io import StringIO

from rich.console import Console

from fakes import STATUS
from netboard.nodes.operator.status_table import status_tables


def test_refusals_are_shown_with_their_counts() -> None:
    console = Console(file=StringIO(), width=80)
    status = replace(
        STATUS, refused=(("handshake", "its key is not known here", 400), ("control", "say hello first", 3))
    )
    console.print(status_tables(status))
    assert isinstance(console.file, StringIO)
    printed = console.file.getvalue()
    assert "refused 400 times: handshake: its key is not known here" in printed
    assert "refused 3 times: control: say hello first" in printed
