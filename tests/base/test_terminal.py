"""Tables on a terminal: rows are distinguishable for any content and width. Progress: bars there, lines elsewhere."""

from io import StringIO

import hypothesis.strategies as st
import pytest
from hypothesis import given
from rich.console import Console
from rich.text import Text

from netboard.base.terminal import bars
from netboard.base.terminal.bars import progress_bars, telling
from netboard.base.terminal.output import FittedTable, numbers, plain_console

NAMES = st.text("abcdefgh-./", min_size=1, max_size=90)


def printed(table: FittedTable, width: int) -> str:
    console = Console(width=width, file=StringIO(), record=True)
    console.print(table)
    return console.export_text()


@given(st.lists(NAMES, min_size=1, max_size=6, unique=True), st.integers(0, 12), st.integers(30, 140))
def test_no_character_of_a_name_is_lost(names: list[str], others: int, width: int) -> None:
    table = FittedTable("", *numbers(*("1" * (place + 3) for place in range(others))))
    for name in names:
        table.add_row(name, *("12345678" for _ in range(others)))
    shown = printed(table, width)
    letters = "".join(letter for letter in shown if letter in "abcdefgh-./")
    assert letters == "".join(names) * (len(letters) // len("".join(names)))
    assert shown.count("12345678") == others * len(names)
    assert all(len(line.rstrip()) <= width for line in shown.splitlines())


@given(st.lists(st.text("abcde ", max_size=200).filter(lambda text: text.strip() != ""), min_size=1, max_size=4))
def test_text_wraps_without_loss(texts: list[str]) -> None:
    table = FittedTable("", "")
    for number, text in enumerate(texts):
        table.add_row(str(number), text)
    shown = printed(table, 60)
    assert "".join(letter for letter in shown if letter in "abcde") == "".join(texts).replace(" ", "")


def test_columns_that_do_not_fit_follow_below_with_the_names() -> None:
    table = FittedTable("peer", "host", *numbers(*(f"column {place}" for place in range(9))), title="Peers")
    table.add_row("left display", "lab-1:17", *("1234567" for _ in range(9)))
    table.add_row("left display", "lab-1:18", *("1234568" for _ in range(9)))
    wide, narrow = printed(table, 200), printed(table, 80)
    assert table.names == 2
    assert (wide.count("lab-1:17"), narrow.count("lab-1:17")) == (1, 2)
    assert narrow.count("Peers") == 1


def test_row_names_are_the_first_columns_that_distinguish_the_rows() -> None:
    table = FittedTable("trial", "attempt", "outcome")
    table.add_row("1", "1", "fell")
    assert table.names == 1
    table.add_row("1", "2", "fell")
    assert table.names == 2
    table.add_row("1", "2", "fell")
    assert table.names == 1


def test_brackets_are_not_markup_and_styles_are_kept() -> None:
    table = FittedTable("length [m]", "")
    table.add_row("[red]", Text("given up", "red"), style="bold")
    assert "length [m]" in printed(table, 80)
    assert "[red]" in printed(table, 80)


def test_row_with_too_many_cells_is_refused() -> None:
    table = FittedTable("a", "b")
    table.add_row("1")
    with pytest.raises(ValueError, match="found 3, expected at most 2"):
        table.add_row("1", "2", "3")


@pytest.mark.parametrize(("terminal", "shown"), [(True, True), (True, False), (False, True)])
def test_progress_bars_appear_on_terminals_only(terminal: bool, shown: bool) -> None:
    console = Console(width=100, file=StringIO(), force_terminal=terminal, record=True, legacy_windows=False)
    with progress_bars(console, "{task.completed} ticks", shown=shown) as progress:
        task = progress.add_task("reading", total=10)
        progress.update(task, completed=4, refresh=True)
    output = console.export_text()
    assert ("reading" in output and "4 ticks" in output) == (terminal and shown)


def test_brackets_in_a_path_or_a_note_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    plain_console(soft_wrap=True).print("/data/[red]pilot[/red]/[/b]/S01.mcap")
    assert capsys.readouterr().out == "/data/[red]pilot[/red]/[/b]/S01.mcap\n"
    console = Console(width=100, file=StringIO(), force_terminal=True, record=True, legacy_windows=False)
    with progress_bars(console) as progress:
        progress.add_task("Reading [/red].mcap")
    assert "Reading [/red].mcap" in console.export_text()


def test_progress_in_a_log_is_a_line_now_and_then(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    seconds = iter([0.0, 30.0, 61.0, 90.0, 150.0])
    monkeypatch.setattr(bars.time, "monotonic", lambda: next(seconds))
    with telling() as tell:
        for done in range(1, 5):
            tell(f"{done} of 4 studies [all]", done, 4)
    assert capsys.readouterr().err.splitlines() == [
        "2 of 4 studies [all]: 50% after 1 min",
        "4 of 4 studies [all]: 100% after 2 min",
    ]
