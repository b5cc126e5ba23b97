"""The figure of a trial shows the values of the tables."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

from netboard.analysis.extraction.details import delays_of
from netboard.analysis.extraction.recordings import Measured
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.trials import AttemptData, BlockData
from netboard.analysis.topics.figure import as_bytes
from netboard.analysis.topics.trial import PANELS, panel, sheet
from netboard.base.errors import NetboardError
from netboard.recording.export.runs import runs_of
from netboard.recording.files.reader import Recording
from netboard.services import explain
from rehearsed_study import measured, rehearse

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    where = tmp_path_factory.mktemp("study")
    rehearse(where, dyads=1, blocks=(10,))
    return where


@pytest.fixture(scope="module")
def takes(folder: Path) -> list[AttemptData]:
    (run,) = runs_of(sorted(folder.glob("*.mcap")))
    with Recording(run.path) as recording:
        return list(BlockData.of(recording, run.config, Readings()).takes())


@pytest.fixture(scope="module")
def tables(folder: Path) -> Measured:
    return measured(folder, Readings())[0]


def axes_of(take: AttemptData, name: str) -> Axes:
    return panel(take, name).axes[0]


def test_every_axis_has_a_unit_and_every_panel_a_title(takes: list[AttemptData]) -> None:
    for take in takes:
        figure = sheet(take).figure
        assert figure is not None
        assert len(figure.axes) == len(PANELS)
        for axes in figure.axes:
            assert axes.get_xlabel() == "time from the release [s]"
            assert axes.get_ylabel().endswith("]")
            assert ": " in axes.get_title(loc="left")


def test_titles_state_the_numbers_of_the_tables(takes: list[AttemptData], tables: Measured) -> None:
    for row, take in enumerate(takes):
        titles = {name: axes_of(take, name).get_title(loc="left") for name in PANELS}
        number = {name: column[row] for name, column in tables.trials.items()}
        if np.isfinite(number["completion"]):
            assert f"{number['completion']:.3f} s" in titles["completion"]
        assert f"{number['peaks']:.0f} to the completion, {number['peaks_whole']:.0f} with" in titles["peaks"]
        total = sum(number[name] for name in ("cooperative", "competitive", "single", "still"))
        assert f"cooperative {number['cooperative'] / total:.0%}" in titles["classes"]
        if np.isfinite(number["braking_onset"]):
            assert f"at {number['braking_onset']:.3f} s" in titles["braking"]


@pytest.mark.parametrize("threshold", ["slower_side", "own_peak"])
@pytest.mark.parametrize("velocity", ["own_direction", "magnitude"])
def test_delay_panel_follows_the_settings(takes: list[AttemptData], threshold: str, velocity: str) -> None:
    words = (f"delays.threshold={threshold}", f"delays.velocity={velocity}")
    readings = parse("", overrides=words)
    take = next(replace(one, block=one.block.again(readings)) for one in takes if delays_of(one)[0].cooperative.any())
    axes = axes_of(take, "delay")
    lines = {str(line.get_label()): np.asarray(line.get_ydata()) for line in axes.lines}
    assert (min(lines["left"].min(), lines["right"].min()) >= 0.0) == (velocity == "magnitude")
    moved, found = delays_of(take)
    k = int(np.argmax(np.where(moved.cooperative, np.abs(take.own_segments.angle), 0.0)))
    peaks = {"left": found.left_peak[k], "right": found.right_peak[k]}
    own = peaks if threshold == "own_peak" else {"": min(peaks.values())}
    for side, peak in own.items():
        assert lines[f"_{side} 20 %"] == pytest.approx([200.0 * peak] * 2)
    whose = "each side's own peak" if threshold == "own_peak" else "the slower side's peak"
    assert f"of {whose} (lines), largest movement" in axes.get_title(loc="left")


def test_peaks_panel_marks_all_peaks(takes: list[AttemptData], tables: Measured) -> None:
    for row, take in enumerate(takes):
        drawn = [line for line in axes_of(take, "peaks").lines if line.get_marker() == "o"]
        assert [len(line.get_xdata()) for line in drawn] == [
            tables.trials["peaks_whole"][row],
            tables.trials["peaks"][row],
        ]


def test_sheet_is_reproducible_to_the_byte(takes: list[AttemptData]) -> None:
    one, other = (as_bytes(panel(takes[0], "peaks"), "svg") for _ in range(2))
    assert one == other
    assert b"<text" in one


def test_command_refuses_to_overwrite_a_sheet(folder: Path, tmp_path: Path) -> None:
    (path,) = folder.glob("*.mcap")
    output = tmp_path / "trial.png"
    assert explain.draw(path, 1, None, Readings(), output).startswith(str(output))
    assert output.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(NetboardError, match="already exists"):
        explain.draw(path, 1, None, Readings(), output)


@pytest.mark.parametrize(
    ("trial", "attempt", "name", "message"),
    [
        (99, None, "a.png", "trials 1 to 3 are there"),
        (1, 9, "a.png", "attempt 9 at trial 1"),
        (1, None, "a.gif", "expected a file that ends with .png"),
        (1, None, "nowhere/a.png", "cannot be written"),
    ],
)
def test_missing_trials_and_invalid_outputs_are_refused(
    folder: Path, tmp_path: Path, trial: int, attempt: int | None, name: str, message: str
) -> None:
    (path,) = folder.glob("*.mcap")
    with pytest.raises(NetboardError, match=message):
        explain.draw(path, trial, attempt, Readings(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []
