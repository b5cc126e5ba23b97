"""Outcomes of fault cases: which ones count, and which ones are repeated."""

from collections import Counter
from dataclasses import replace

from netboard.benchmarks.faults.bench import CASES, MAX_AGAIN, Outcome, judged, told_again
from netboard.benchmarks.harness.results import Verdict

SOUND = Outcome(CASES[0], (Verdict("it holds", True, "it does"),))
FAILED = Outcome(CASES[1], (Verdict("it holds", False, "it does not"),))
SPOILED = replace(FAILED, disturbed="the server stalled for 28 ms")


def test_failed_case_counts_if_the_machine_was_undisturbed() -> None:
    again: Counter[str] = Counter()
    assert judged([SOUND, FAILED], again) == [SOUND, FAILED]
    assert not again


def test_disturbed_case_is_repeated_a_limited_number_of_times() -> None:
    again: Counter[str] = Counter()
    for _ in range(MAX_AGAIN):
        assert judged([SOUND, SPOILED], again) == [SOUND]
    (_, last) = judged([SOUND, SPOILED], again)
    assert not last.holds
    assert last.again == MAX_AGAIN


def test_number_of_repeats_is_reported() -> None:
    assert told_again([SOUND, FAILED]).endswith(": 0 times")
    again = Counter({SOUND.case.name: 1})
    (waited,) = judged([replace(SOUND, again=2)], again)
    assert told_again([waited, FAILED]).endswith(f": 3 times: {SOUND.case.name} (3)")
