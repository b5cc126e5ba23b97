"""Outcomes of fault cases: which ones count, and which ones are repeated."""

from collections import Counter
from dataclasses import replace

from evidence.faults.bench import CASES, MAX_REPETITIONS, Outcome, repetitions_line, without_repeated
from netboard.benchmarks.harness.results import BenchVerdict

SOUND = Outcome(CASES[0], (BenchVerdict("it holds", True, "it does"),))
FAILED = Outcome(CASES[1], (BenchVerdict("it holds", False, "it does not"),))
SPOILED = replace(FAILED, disturbed="the server stalled for 28 ms")


def test_failed_case_counts_if_the_machine_was_undisturbed() -> None:
    again: Counter[str] = Counter()
    assert without_repeated([SOUND, FAILED], again) == [SOUND, FAILED]
    assert not again


def test_disturbed_case_is_repeated_a_limited_number_of_times() -> None:
    again: Counter[str] = Counter()
    for _ in range(MAX_REPETITIONS):
        assert without_repeated([SOUND, SPOILED], again) == [SOUND]
    (_, last) = without_repeated([SOUND, SPOILED], again)
    assert not last.holds
    assert last.repetitions == MAX_REPETITIONS


def test_number_of_repeats_is_reported() -> None:
    assert repetitions_line([SOUND, FAILED]).endswith(": 0 times")
    again = Counter({SOUND.case.name: 1})
    (waited,) = without_repeated([replace(SOUND, repetitions=2)], again)
    assert repetitions_line([waited, FAILED]).endswith(f": 3 times: {SOUND.case.name} (3)")
