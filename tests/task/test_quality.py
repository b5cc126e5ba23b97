"""Quality rules of attempts: each flag, chunks of any size, and the reset at each release."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.config import Config, parse
from netboard.base.safeguards import Safeguard
from netboard.base.tables.experiment import Block, Quality
from netboard.base.tables.scene import Physics
from netboard.base.tick import LATE_NS, TICK
from netboard.recording.format.summary import find_attempts
from netboard.stage.stage import make_stage
from netboard.task.trials.quality import (
    FLAGS,
    REPORT_TICKS,
    Referee,
    Verdict,
    empty_tally,
    judge,
    longest_gap,
    tally,
)
from netboard.task.trials.state_machine import Cause, Phase

LEVEL, LENGTH, AFTER = 20, 3000, 10
NAN = float("nan")
CLAMPED = int(Safeguard.CLAMPED)


def attempt(
    length: int = LENGTH, cause: Cause = Cause.HELD, trial: int = 1, number: int = 1, tick: int = 0
) -> np.ndarray:
    """Rows of an unflagged attempt: levelling, running, holding, its end, and the ticks after it."""
    rows = np.zeros(LEVEL + length + AFTER, TICK)
    rows["tick"] = tick + np.arange(rows.size)
    rows["trial"], rows["attempt"] = trial, number
    rows["phase"][:LEVEL] = Phase.LEVELLING
    rows["event"][LEVEL - 1] = Cause.LEVEL
    free = slice(LEVEL, LEVEL + length)
    rows["phase"][free] = Phase.RUNNING
    rows["run_ticks"][free] = np.arange(length)
    held = slice(LEVEL + length // 2, LEVEL + length)
    rows["phase"][held] = Phase.HOLDING
    rows["event"][held.start - 1] = Cause.ENTERED
    rows["mark_ticks"][held] = length // 2
    rows["event"][held.stop - 1] = cause
    rows["phase"][held.stop :] = Phase.SUCCEEDED
    for side in ("left", "right"):
        rows[f"{side}_live"] = 1
        rows[f"{side}_stamp_ns"] = 10**9 + rows["tick"] * 10**6
        rows[f"{side}_sent_z"] = 0.01 * np.sin(rows["tick"] / 100)
        rows[f"{side}_used_z"] = rows[f"{side}_sent_z"]
    return rows


def free(rows: np.ndarray) -> np.ndarray:
    return rows[LEVEL : LEVEL + LENGTH]


def verdicts(rows: np.ndarray, config: Config | None = None, chunks: list[int] | None = None) -> list[Verdict]:
    referee = Referee(config or Config(), CLAMPED)
    found: list[Verdict] = []
    first = 0
    for chunk in [*(chunks or []), rows.size]:
        count = min(chunk, rows.size - first)
        found += referee.watch(rows, first, count)
        first += count
    return found


def flags(rows: np.ndarray, config: Config | None = None) -> tuple[str, ...]:
    (found,) = verdicts(rows, config)
    return found.flags


def test_clean_attempt_has_no_flag() -> None:
    (found,) = verdicts(attempt())
    assert found == Verdict(1, 1, LEVEL, LEVEL + LENGTH - 1, Cause.HELD, LENGTH / 2 * 1e-3, ())
    assert found.outcome == "success"


@pytest.mark.parametrize(
    ("cause", "outcome"),
    [
        (Cause.FELL, "fell"),
        (Cause.ABORT, "aborted"),
        (Cause.STOP, "aborted"),
        (Cause.PAUSE, "paused"),
        (Cause.FAULT, "paused"),
    ],
)
def test_cause_of_the_end_determines_the_outcome(cause: Cause, outcome: str) -> None:
    (found,) = verdicts(attempt(cause=cause))
    assert found.outcome == outcome
    assert np.isnan(found.completion)
    assert found.flags == ()


def test_other_causes_of_the_end_give_the_outcome_skipped() -> None:
    assert Verdict(1, 1, 0, 9, Cause.LAST, NAN, ()).outcome == "skipped"


def test_more_than_20_late_ticks_after_release_are_flagged() -> None:
    rows = attempt()
    free(rows)["late_ns"][:20] = LATE_NS + 1
    free(rows)["late_ns"][20:] = LATE_NS
    rows["late_ns"][:LEVEL] = rows["late_ns"][-AFTER:] = LATE_NS + 1
    assert flags(rows) == ()
    free(rows)["late_ns"][20] = LATE_NS + 1
    assert flags(rows) == ("late_ticks",)


@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize(
    ("field", "value", "word", "share"),
    [
        ("live", 0, "lost_samples", 0.02),
        ("stamp_ns", 77, "lost_samples", 0.02),
        ("safeguards", CLAMPED | int(Safeguard.ARMED), "clipped", 0.05),
        ("used_z", -0.075, "saturated", 0.05),
        ("used_z", 0.075, "saturated", 0.05),
    ],
)
def test_share_above_its_limit_is_flagged(side: str, field: str, value: float, word: str, share: float) -> None:
    rows = attempt()
    rows[f"{side}_safeguards"] = Safeguard.ARMED | Safeguard.SLEWED
    most = round(share * LENGTH) + (field == "stamp_ns")  # the first sample with another stamp is fresh
    free(rows)[f"{side}_{field}"][5 : 5 + most] = value
    rows[f"{side}_{field}"][:LEVEL] = rows[f"{side}_{field}"][-AFTER:] = value
    assert flags(rows) == ()
    free(rows)[f"{side}_{field}"][5 + most] = value
    assert flags(rows) == (word,)


def test_sample_repeated_from_before_the_release_counts_as_lost() -> None:
    rows = attempt()
    rows["left_stamp_ns"] = 10**9 + rows["tick"] // 2 * 10**6
    counts = empty_tally()
    tally(counts, rows, 0, rows.size, 0.075, CLAMPED)
    assert counts["lost"].tolist() == [LENGTH // 2, 0]


@pytest.mark.parametrize("tilt_deg", [1.51, -1.51])
def test_tilt_above_1_5_deg_at_the_release_is_flagged(tilt_deg: float) -> None:
    rows = attempt()
    rows["theta"] = np.radians(tilt_deg)
    free(rows)["theta"][0] = np.radians(1.49)
    assert flags(rows) == ()
    free(rows)["theta"][0] = np.radians(tilt_deg)
    assert flags(rows) == ("start_tilt",)
    # A recording that begins behind the release does not tell.
    assert flags(rows[LEVEL + 1 :]) == ()


@pytest.mark.parametrize("first", [LEVEL - 5, LEVEL, LEVEL + 500])
def test_more_than_20_missing_ticks_are_flagged(first: int) -> None:
    rows = attempt()
    lost = max(LEVEL, first) - first + 20  # those of the levelling do not count
    assert flags(np.delete(rows, slice(first, first + lost))) == ()
    assert flags(np.delete(rows, slice(first, first + lost + 1))) == ("missing_ticks",)
    scattered = np.arange(max(LEVEL, first), LEVEL + LENGTH - 1, 100)[:21]
    assert flags(np.delete(rows, scattered)) == ("missing_ticks",)
    assert flags(np.delete(rows, scattered), Config(quality=Quality(missing_ticks=21))) == ()


@pytest.mark.parametrize("side", ["left", "right"])
def test_stylus_without_motion_for_2_s_is_flagged(side: str) -> None:
    rows = attempt()
    free(rows)[f"{side}_sent_z"][100 : 100 + 2001] = 0.03
    assert flags(rows) == ()
    free(rows)[f"{side}_sent_z"][100 : 100 + 2002] = 0.03
    assert flags(rows) == (f"stuck_{side}",)
    # A sample that did not come neither ends nor lengthens that.
    free(rows)[f"{side}_live"][500] = 0
    free(rows)[f"{side}_sent_z"][500] = 0.0
    assert flags(rows) == ()
    free(rows)[f"{side}_sent_z"][2102] = 0.03
    assert flags(rows) == (f"stuck_{side}",)


def test_rest_of_a_stylus_before_the_release_does_not_count() -> None:
    rows = np.concatenate([attempt()[:LEVEL]] * 200 + [attempt()[LEVEL:]])
    rows["left_sent_z"][: 199 * LEVEL + LEVEL + 100] = 0.0
    rows["tick"] = np.arange(rows.size)
    assert flags(rows) == ()


def test_robot_is_never_stuck_and_a_fixed_hand_never_loses_samples() -> None:
    rows = attempt()
    rows["right_sent_z"] = 0.0
    assert flags(rows) == ("stuck_right",)
    assert flags(rows, Config(block=Block(right="robot"))) == ()
    rows["right_live"] = 0
    assert flags(rows, Config(block=Block(right="robot"))) == ("lost_samples",)
    assert flags(rows, Config(block=Block(right="still"))) == ()


def test_completion_outside_its_limits_is_flagged() -> None:
    t = empty_tally()
    for completion, words in ((0.29, ("too_short",)), (0.3, ()), (60.0, ()), (60.1, ("too_long",)), (NAN, ())):
        assert judge(t, completion, 0.0, Quality(), Block()) == words


def test_flags_are_listed_in_a_fixed_order() -> None:
    rows = attempt(600)
    rows["theta"], rows["late_ns"], rows["left_live"] = 1.0, 10**6, 0
    (found,) = verdicts(rows, Config(quality=Quality(shortest=1.0)))
    assert found.flags == ("late_ticks", "lost_samples", "start_tilt", "too_short")
    assert tuple(word for word in FLAGS if word in found.flags) == found.flags


def test_quality_limits_are_configurable() -> None:
    rows = attempt()
    free(rows)["late_ns"] = 10**6
    assert flags(rows, Config(quality=Quality(late_ticks=LENGTH))) == ()


def test_counts_are_reset_for_every_attempt() -> None:
    spoilt, clean = attempt(), attempt(number=2, tick=5000)
    free(spoilt)["late_ns"] = 10**6
    free(spoilt)["left_safeguards"] = CLAMPED
    both = np.concatenate([spoilt, clean])
    assert [found.flags for found in verdicts(both)] == [("late_ticks", "clipped"), ()]
    # Even if the ticks between them are lost, and even if the second comes at once.
    assert [found.flags for found in verdicts(np.concatenate([free(spoilt)[:-7], free(clean)]))] == [()]
    again = attempt(number=1, tick=5000)
    assert [found.flags for found in verdicts(np.concatenate([free(spoilt), free(again)]))] == [
        ("late_ticks", "clipped"),
        (),
    ]


def test_ring_buffer_is_read_across_its_end() -> None:
    rows = attempt(600)
    rows["left_live"][50:90] = 0
    ring = np.zeros(64, TICK)
    referee = Referee(Config(), CLAMPED)
    found: list[Verdict] = []
    for number, row in enumerate(rows):
        ring[number % 64] = row
        if number % 10 == 9:
            found += referee.watch(ring, number - 9, 10)
    assert found == verdicts(rows)
    assert found[0].flags == ("lost_samples",)
    assert referee.counts["lost"].tolist() == [40, 0]


@st.composite
def streams(draw: st.DrawFn) -> np.ndarray:
    """Some attempts with random values in every field that the rules use."""
    generator = np.random.default_rng(draw(st.integers(0, 2**32)))
    parts = []
    for number in range(draw(st.integers(1, 4))):
        cause = draw(st.sampled_from([Cause.HELD, Cause.FELL, Cause.TIMED_OUT, Cause.PAUSE, Cause.ABORT]))
        parts.append(attempt(draw(st.integers(2, 60)), cause, number=number + 1))
    rows = np.concatenate(parts)
    rows["tick"] = np.arange(rows.size)
    rows["theta"] = generator.normal(0, 0.02, rows.size)
    rows["late_ns"] = generator.integers(0, 2 * LATE_NS, rows.size)
    for side in ("left", "right"):
        rows[f"{side}_live"] = generator.random(rows.size) < 0.95
        rows[f"{side}_stamp_ns"] = generator.integers(0, 3, rows.size)
        rows[f"{side}_sent_z"] = generator.integers(0, 2, rows.size) / 10
        rows[f"{side}_used_z"] = generator.uniform(-0.08, 0.08, rows.size)
        rows[f"{side}_safeguards"] = generator.integers(0, 2048, rows.size)
    return rows


@given(streams(), st.lists(st.integers(0, 40), max_size=40))
@settings(max_examples=50, deadline=None)
def test_verdicts_are_independent_of_chunk_sizes(rows: np.ndarray, chunks: list[int]) -> None:
    rules = Quality(late_ticks=12, lost_share=0.5, saturated_share=0.06, stuck=0.004, shortest=0.01)
    config = Config(quality=rules)
    assert repr(verdicts(rows, config, chunks)) == repr(verdicts(rows, config))
    whole, chunked = empty_tally(), empty_tally()
    _take(whole, rows, [rows.size])
    _take(chunked, rows, [*chunks, rows.size])
    assert whole.tobytes() == chunked.tobytes()


def _take(counts: np.void, rows: np.ndarray, chunks: list[int]) -> None:
    first = 0
    for count in chunks:
        stop = min(first + count, rows.size)
        while first < stop:
            first += tally(counts, rows, first, stop - first, 0.075, CLAMPED)


@given(st.integers(0, 2**32))
@settings(max_examples=50, deadline=None)
def test_arbitrary_rows_give_only_known_flags(seed: int) -> None:
    rows = np.frombuffer(np.random.default_rng(seed).bytes(200 * TICK.itemsize), TICK).copy()
    rows["phase"] = np.random.default_rng(seed).integers(-1, 9, 200)
    referee = Referee(Config(), CLAMPED)
    assert all(set(found.flags) <= set(FLAGS) for found in referee.watch(rows, 0, 200))


def test_referee_finds_the_attempts_of_a_simulated_block() -> None:
    config = parse("[task]\nlevel_time = 0.05\nlevel_rate_deg_s = 300\nlevel_angle_deg = 40\ntime_limit = 1.0")
    stage = make_stage(config)
    state = stage.initial()
    generator = np.random.default_rng(7)
    rows = np.zeros(20_000, TICK)
    rows["tick"] = np.arange(rows.size)
    rows["time_ns"] = 10**9 + rows["tick"] * 10**6
    rows["command"][10] = Cause.START
    for tick, cause in ((6000, Cause.PAUSE), (6500, Cause.RESUME), (9000, Cause.ABORT), (15_000, Cause.ABORT)):
        rows["command"][tick] = cause
    for side in ("left", "right"):
        rows[f"{side}_live"] = 1
        rows[f"{side}_stamp_ns"] = rows["time_ns"]
        steps = generator.normal(0, 0.02, rows.size // 1000).repeat(1000)
        rows[f"{side}_sent_z"] = steps
    stage.advance(state, rows, 0, rows.size)
    known = [found for found in find_attempts(rows) if found.outcome != "unfinished"]
    found = verdicts(rows, config)
    assert len(found) > 5
    assert [(a.trial, a.attempt, a.tick, a.tick + round(a.duration * 1e3) - 1) for a in known] == [
        (v.trial, v.attempt, v.release, v.end) for v in found
    ]
    for one, other in zip(known, found, strict=True):
        assert other.outcome == {"abort": "aborted", "pause": "paused"}.get(one.outcome, one.outcome)
        assert repr(one.completion) == repr(other.completion)


# --- displays --------------------------------------------------------------------------------------------------------


def frames(first: int, last: int, step: int = 16) -> list[tuple[int, int]]:
    return [(tick, 5_000_000_000 + tick * 1_000_000) for tick in range(first, last, step)]


def test_longest_gap_between_frames_within_an_attempt() -> None:
    release, end = 1000, 4000
    stop = end - REPORT_TICKS
    assert longest_gap(frames(0, 5000), release, end) == pytest.approx(0.016)
    assert longest_gap(frames(0, 2000) + frames(2400, 5000), release, end) == pytest.approx(0.4, abs=0.017)
    # Nothing at the beginning, nothing at the end, nothing at all.
    assert longest_gap(frames(1300, 5000), release, end) == pytest.approx(0.3)
    assert longest_gap(frames(0, 2000), release, end) == pytest.approx((stop - 2000) * 1e-3, abs=0.017)
    assert longest_gap([], release, end) == pytest.approx((stop - release) * 1e-3)
    # What the last reports may not have told yet does not count, nor what was before.
    assert longest_gap(frames(0, stop), release, end) <= 0.016
    assert longest_gap(frames(release, 5000), release, end) <= 0.016
    # An attempt that was over before any report says nothing.
    assert longest_gap([], release, release + REPORT_TICKS) == 0.0


def test_late_painting_counts_as_a_gap() -> None:
    shown = frames(0, 2000) + [(tick, painted + 300_000_000) for tick, painted in frames(2000, 5000)]
    assert longest_gap(shown, 1000, 4000) == pytest.approx(0.316)


def test_change_of_display_clock_is_no_gap() -> None:
    later = [(tick, painted + 10**15) for tick, painted in frames(2000, 5000)]  # on another machine
    assert longest_gap(frames(0, 2000) + later, 1000, 4000) <= 0.034
    both = sorted(frames(0, 5000) + [(tick + 3, painted - 10**15) for tick, painted in frames(0, 5000)])
    assert longest_gap(both, 1000, 4000) <= 0.017
    assert longest_gap(both[::-1], 1000, 4000) == longest_gap(both, 1000, 4000)


def watched(config: Config, painted: dict[str, list[tuple[int, int]]]) -> tuple[str, ...]:
    """Flags of an attempt whose frames are reported 500 ms after they were painted."""
    rows = attempt()
    referee = Referee(config, CLAMPED)
    found: list[Verdict] = []
    for first in range(0, rows.size, 10):
        found += referee.watch(rows, first, min(10, rows.size - first))
        for station, shown in painted.items():
            for tick, painted_ns in shown:
                if first <= tick + 500 < first + 10:
                    referee.paint(station, tick, painted_ns)
    (verdict,) = found
    return verdict.flags


def test_gap_of_a_connected_display_is_flagged() -> None:
    whole, with_gap = frames(0, 4000), frames(0, 1000) + frames(1300, 4000)
    config = Config()
    assert watched(config, {"left": whole, "right": whole}) == ()
    assert watched(config, {"left": with_gap, "right": whole}) == ("frozen_display",)
    assert watched(config, {"left": whole, "right": with_gap}) == ("frozen_display",)
    # A display that was never there is not frozen; one that is gone is.
    assert watched(config, {"left": whole}) == ()
    assert watched(config, {"left": whole, "right": frames(0, 100)}) == ("frozen_display",)


def test_only_displays_of_participants_who_see_a_ball_count() -> None:
    whole, with_gap = frames(0, 4000), frames(0, 1000) + frames(1300, 4000)
    bimanual = Config(block=Block(configuration="bimanual", station="right"))
    assert watched(bimanual, {"left": with_gap, "right": whole}) == ()
    assert watched(bimanual, {"left": whole, "right": with_gap}) == ("frozen_display",)
    alone = Config(block=Block(left="robot"))
    assert watched(alone, {"left": with_gap, "right": whole}) == ()
    assert watched(alone, {"left": whole, "right": with_gap}) == ("frozen_display",)
    assert watched(replace(Config(), physics=Physics(balls=0)), {"left": with_gap, "right": with_gap}) == ()


def test_frames_outside_attempts_are_discarded() -> None:
    referee = Referee(Config(), CLAMPED)
    for tick, painted_ns in frames(0, 10_000):
        referee.paint("left", tick, painted_ns)
    assert referee._frames == {"left": []}


def test_documentation_lists_every_flag() -> None:
    page = (Path(__file__).parents[2] / "docs" / "explanation" / "quality.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE) == list(FLAGS)
