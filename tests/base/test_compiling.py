"""What a first start shows while it compiles: a bar on a terminal, one line elsewhere, one line above other bars."""

from collections.abc import Callable, Iterator
from io import StringIO
from threading import Event

import pytest
from rich.console import Console

from netboard.base import kernel_cache
from netboard.base.compilation import UNKNOWN, Forecast, compilation
from netboard.base.terminal import compiling
from netboard.base.terminal.bars import progress_bars, shown_bars
from netboard.base.terminal.compiling import WORDS, CompilationBar, watch_cache
from netboard.nodes.launching.kernels import EXPECTED
from netboard.services.guard import KERNELS

SHARES = (0.2, 0.3, 0.35, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0)


def made(monkeypatch: pytest.MonkeyPatch, *, terminal: bool, expected: int = 100) -> tuple[CompilationBar, Console]:
    """Return a bar and its console; each look at the clock is one second later."""
    console = Console(width=100, file=StringIO(), force_terminal=terminal, record=True, legacy_windows=False)
    seconds: Iterator[float] = iter(range(1000))
    monkeypatch.setattr(compiling, "plain_console", lambda **options: console)
    monkeypatch.setattr(compiling, "SHOWN_AFTER_S", 2.0)
    monkeypatch.setattr(compiling.time, "monotonic", lambda: next(seconds))
    return CompilationBar(Forecast(expected, SHARES)), console


def test_without_a_terminal_one_line_says_how_many_and_how_long(monkeypatch: pytest.MonkeyPatch) -> None:
    bar, console = made(monkeypatch, terminal=False)
    for count in range(20):
        bar.compiled(count)
    bar.rests()
    assert console.export_text() == f"{WORDS}: 10 kernels took 10 s; about 90 are left, for about 40 s\n"


def test_short_compilation_has_no_line_and_time_between_two_is_not_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    bar, console = made(monkeypatch, terminal=False, expected=20)
    bar.compiled(0)
    bar.rests()
    for _ in range(50):
        compiling.time.monotonic()
    bar.compiled(1)
    assert console.export_text() == ""
    bar.compiled(2)
    assert "2 kernels took 2 s" in console.export_text()


@pytest.mark.parametrize("expected", [0, 2])
def test_number_that_is_unknown_or_exceeded_promises_nothing(monkeypatch: pytest.MonkeyPatch, expected: int) -> None:
    bar, console = made(monkeypatch, terminal=False, expected=expected)
    for count in range(5):
        bar.compiled(count)
    assert console.export_text() == f"{WORDS}: 2 kernels so far, in 2 s\n"


def test_on_a_terminal_a_bar_appears_and_leaves_the_words(monkeypatch: pytest.MonkeyPatch) -> None:
    bar, console = made(monkeypatch, terminal=True)
    for count in range(25):
        bar.compiled(count)
    bar.compiled(25)
    shown = shown_bars()
    assert shown is not None
    assert shown.tasks[0].percentage == pytest.approx(100 * 0.325)
    bar.compiled(100)
    assert 98 < shown.tasks[0].percentage < 100, "it is not over before it rests"
    bar.rests()
    assert shown_bars() is None
    bar.compiled(101)
    assert shown_bars() is shown
    bar.rests()
    output = console.export_text()
    assert output.count(WORDS) == 1
    assert "25 of about 100 kernels" in output or "101 of about 102 kernels" in output


def test_line_is_printed_above_the_bars_of_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    bar, console = made(monkeypatch, terminal=True)
    with progress_bars(console) as others:
        others.add_task("studies")
        for count in range(20):
            bar.compiled(count)
        bar.rests()
        assert shown_bars() is others
    assert f"{WORDS}: 10 kernels took 10 s; about 90 are left, for about 40 s\n" in console.export_text()


def test_share_of_the_time_is_interpolated_between_the_measured_tenths() -> None:
    forecast = Forecast(200, SHARES)
    counts = (0, 10, 20, 30, 195, 200, 300)
    assert [forecast.share(count) for count in counts] == pytest.approx([0.0, 0.1, 0.2, 0.25, 0.975, 1.0, 1.0])


@pytest.mark.parametrize("forecast", [EXPECTED, *KERNELS.values()])
def test_each_forecast_grows_up_to_the_whole_time(forecast: Forecast) -> None:
    assert len(forecast.shares) == 10
    assert sorted({0.0, *forecast.shares}) == [0.0, *forecast.shares]
    assert forecast.shares[-1] == 1.0


def test_nothing_is_promised_of_kernels_that_are_in_the_cache_already() -> None:
    forecast = Forecast(200, SHARES)
    assert forecast.with_cached(0) is forecast
    assert forecast.with_cached(150) == Forecast(50), "an interrupted preparation; which of them are left is not known"
    assert forecast.with_cached(230) == UNKNOWN, "those of a new robot partner are compiled, and of no other"


def test_kernels_of_workers_are_said_in_one_line_also_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    bar, console = made(monkeypatch, terminal=True)
    bar = CompilationBar(drawn=False)
    counts, looks = iter([200, 200, 203, 203, 205, 206, 207, 208]), iter([False] * 7 + [True])
    watch_cache(lambda: next(counts), lambda seconds: next(looks), bar)
    assert shown_bars() is None
    assert console.export_text() == f"{WORDS}: 6 kernels so far, in 2 s\n"


def test_workers_that_load_all_from_the_cache_have_no_line(monkeypatch: pytest.MonkeyPatch) -> None:
    bar, console = made(monkeypatch, terminal=False, expected=0)
    looks = iter([False] * 7 + [True])
    watch_cache(lambda: 200, lambda seconds: next(looks), bar)
    assert console.export_text() == ""


def test_kernels_that_this_process_compiles_are_not_those_of_its_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    """They have a bar of their own."""
    seen: list[int] = []
    begun = Event()

    def watch(count: Callable[[], int], over: Callable[[float], bool], bar: CompilationBar) -> None:
        seen.append(count())
        begun.set()
        over(60.0)
        seen.append(count())

    monkeypatch.setattr(compiling, "watch_cache", watch)
    monkeypatch.setattr(compilation, "_count", 7)
    found = iter([107, 110])
    monkeypatch.setattr(kernel_cache, "count", lambda: next(found))
    with compiling.workers_compilation():
        begun.wait()
        compilation.ends()
    assert seen == [100, 102]
