"""The recorded hands with other parameters: identical without changes, else as closed forms and other parts predict."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import rehearsed
from netboard.base.config import Config
from netboard.recording.counterfactual.figure import draw
from netboard.recording.counterfactual.what_if import attempt_to_show, save, ticks_of_attempts, what_if
from netboard.recording.files.reader import Recording
from netboard.recording.files.writer import RecordingWriter
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.verification import verify
from netboard.stage.stage import make_stage
from netboard.task.trials.state_machine import BALL_FREE

pytestmark = pytest.mark.slow


def changed(**physics: object) -> Config:
    config = rehearsed.config()
    return replace(config, physics=replace(config.physics, **physics))


def test_unchanged_parameters_reproduce_every_tick_bit_for_bit() -> None:
    rows = np.delete(rehearsed.rows(), slice(100, 120))
    found = what_if(rows, make_stage(rehearsed.config()))
    assert found.identical
    assert found.computed.tobytes() == rows.tobytes()
    assert [one.now.outcome for one in found.comparisons] == ["success", "success"]
    for one in found.comparisons:
        assert repr(one.now) == repr(replace(one.then, began=one.then.tick))
        assert one.common == one.then.stop - one.then.tick
        assert all(apart == (0.0, 0.0) for apart in one.differences.values())
        assert not one.changed


def test_force_condition_does_not_change_the_board() -> None:
    config = rehearsed.config()
    rows = rehearsed.rows()
    found = what_if(rows, make_stage(replace(config, block=replace(config.block, force="none"))))
    for one in found.comparisons:
        assert not one.changed
        assert one.differences["theta"] == one.differences["p"] == (0.0, 0.0)
        then = rows[np.searchsorted(rows["tick"], one.then.tick) :][: one.common]
        assert one.differences["left_force"].rms == pytest.approx(np.sqrt(np.mean(then["left_force"] ** 2)))
        assert one.differences["right_force"].largest == np.abs(then["right_force"]).max()


def test_half_force_scale_halves_the_force() -> None:
    config = rehearsed.config()
    found = what_if(rehearsed.rows(), make_stage(replace(config, block=replace(config.block, force_scale=0.5))))
    np.testing.assert_array_equal(found.computed["left_force"], 0.5 * found.recorded["left_force"])


def test_ball_rolls_at_constant_speed_without_gravity() -> None:
    found = what_if(rehearsed.rows(), make_stage(changed(g=0.0)))
    assert {one.now.outcome for one in found.comparisons} == {"unfinished"}
    for one in found.comparisons:
        start = np.searchsorted(found.computed["tick"], one.then.tick)
        part = found.computed[start : start + one.common]
        t = np.arange(one.common) * 1e-3
        np.testing.assert_allclose(part["p"], part["p"][0] + part["vp"][0] * t, rtol=0, atol=1e-12)


def test_each_attempt_starts_from_the_recorded_release() -> None:
    found = what_if(rehearsed.rows(), make_stage(changed(k_h=400.0)))
    assert not found.identical
    for one in found.comparisons:
        start = np.searchsorted(found.computed["tick"], one.then.tick)
        for name in ("theta", "omega", "p", "vp", "z", "vz", "trial", "attempt"):
            assert found.computed[name][start] == found.recorded[name][start]


def test_missing_ticks_in_an_attempt_add_no_ticks_from_after_it() -> None:
    (first, *_) = what_if(rehearsed.rows(), make_stage(rehearsed.config())).comparisons
    rows = np.delete(rehearsed.rows(), slice(first.then.tick + 500, first.then.tick + 1500))
    found = what_if(rows, make_stage(changed(k_h=400.0)))
    for one in found.comparisons:
        stop = min(one.then.stop, one.now.stop)
        assert one.common == np.count_nonzero((rows["tick"] >= one.then.tick) & (rows["tick"] < stop))
    kept = ticks_of_attempts(found)
    assert np.isin(found.recorded["phase"][np.isin(rows["tick"], kept["tick"])], BALL_FREE).all()
    line = draw(found, [], found.comparisons[0]).axes[0].lines[0]
    assert len(line.get_xdata()) == first.then.stop - first.then.tick - 1000
    assert line.get_xdata()[500] == 1.5


def test_attempt_is_unfinished_if_the_ticks_after_its_end_are_missing() -> None:
    (first, *_) = what_if(rehearsed.rows(), make_stage(rehearsed.config())).comparisons
    rows = np.delete(rehearsed.rows(), slice(first.then.stop, first.then.stop + 20))
    found = what_if(rows, make_stage(changed(g=0.0)))
    assert {one.now.outcome for one in found.comparisons} == {"unfinished"}


def test_interrupted_save_leaves_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    found = what_if(rehearsed.rows(), make_stage(rehearsed.config()))
    with Recording(rehearsed.write(tmp_path / "a.mcap", rehearsed.rows())) as recording:
        source = recording.metadata

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(RecordingWriter, "is_due", interrupt)
    with pytest.raises(KeyboardInterrupt):
        save(tmp_path / "b.mcap", found, rehearsed.config(), source, "a.mcap", [])
    assert [path.name for path in tmp_path.iterdir()] == ["a.mcap"]


def test_source_that_lost_its_start_time_can_be_saved(tmp_path: Path) -> None:
    found = what_if(rehearsed.rows(), make_stage(rehearsed.config()))
    with Recording(rehearsed.write(tmp_path / "a.mcap", rehearsed.rows())) as recording:
        source = {name: value for name, value in recording.metadata.items() if name != "opened_log_ns"}
    kept = save(tmp_path / "b.mcap", found, rehearsed.config(), source, "a.mcap", [])
    with Recording(tmp_path / "b.mcap") as recording:
        assert len(recording.ticks()) == kept


def test_saved_result_verifies_and_names_its_source(tmp_path: Path) -> None:
    config, source = changed(model="lagrangian"), rehearsed.write(tmp_path / "a.mcap", rehearsed.rows())
    with Recording(source) as recording:
        found = what_if(recording.ticks(), make_stage(config))
        kept = save(tmp_path / "b.mcap", found, config, recording.metadata, "a.mcap", ["physics.model=lagrangian"])
    rows = ticks_of_attempts(found)
    assert verify(make_stage(config), rows).identical
    report = check(tmp_path / "b.mcap", replay=True)
    assert (report.result, report.ticks) == ("complete with listed losses", kept)
    with Recording(tmp_path / "b.mcap") as recording:
        assert recording.ticks().tobytes() == rows.tobytes()
        assert recording.metadata["source_session"] == rehearsed.SESSION != recording.metadata["session"]


def test_figure_has_units_on_every_axis(tmp_path: Path) -> None:
    found = what_if(rehearsed.rows(), make_stage(changed(k_h=400.0)))
    figure = draw(found, ["physics.k_h=400"])
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert len(labels) == 8
    assert all(label.endswith(")") for label in labels)
    shown = attempt_to_show(found.comparisons)
    assert f"trial {shown.then.trial}" in figure.axes[0].get_title()
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").read_bytes()[:4] == b"\x89PNG"
