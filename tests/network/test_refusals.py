"""Refusals are counted completely, and reported at a limited rate."""

from netboard.network.transport.refusal_count import (
    CHECK_INTERVAL_NS,
    MAX_KINDS,
    MAX_REASONS,
    MAX_REPORTS,
    OTHER_REASONS,
    OTHERS,
    RefusalCounter,
)

SECOND = 1_000_000_000


def details(reason: str, peer: str = "x") -> dict[str, str]:
    return {"peer": peer, "reason": reason}


def test_refusals_are_reported_at_once_then_less_often_and_in_total_last() -> None:
    count = RefusalCounter()
    reported = []
    for millisecond in range(10_000):
        count.count(("x", "why"), details("why"))
        reported += [(millisecond, report["times"]) for report in count.reports(millisecond * 1_000_000)]
    assert reported == [(0, "1"), (1000, "1001"), (3000, "3001"), (7000, "7001")]
    assert count.final_reports() == [details("why") | {"times": "10000"}]
    assert count.final_reports() == []
    assert count.totals == {"why": 10_000}


def test_single_burst_of_refusals_is_reported_in_full() -> None:
    count = RefusalCounter()
    for _ in range(400):
        count.count(("x", "why"), details("why"))
        count.reports(0)
    assert [report["times"] for report in count.reports(SECOND)] == ["400"]


def test_number_of_reports_is_limited_and_none_is_lost() -> None:
    count = RefusalCounter()
    for number in range(60):
        count.count((str(number),), details("why", str(number)))
    reported: list[dict[str, str]] = []
    for look in range(20):
        reports = count.reports(look * CHECK_INTERVAL_NS)
        assert len(reports) <= MAX_REPORTS
        assert count.reports(look * CHECK_INTERVAL_NS + 1) == [] or len(reports) < MAX_REPORTS
        reported += reports
    assert sorted(int(report["peer"]) for report in reported) == list(range(60))


def test_kinds_and_reasons_beyond_the_maximum_are_counted_together() -> None:
    count = RefusalCounter()
    for number in range(4 * MAX_KINDS):
        count.count((str(number),), {"channel": "log"} | details(f"why {number}", str(number)))
    rest = count.final_reports()
    assert len(rest) == 2 * MAX_KINDS + 1
    assert rest[-1] == {"channel": "log", "peer": OTHERS, "reason": OTHER_REASONS, "times": str(2 * MAX_KINDS)}
    assert sum(int(report["times"]) for report in rest) == 4 * MAX_KINDS
    assert len(count.totals) == MAX_REASONS + 1
    assert sum(count.totals.values()) == 4 * MAX_KINDS


def test_excess_unknown_peers_are_counted_by_channel_and_reason() -> None:
    count = RefusalCounter()
    for number in range(400):
        count.count((str(number),), {"channel": "motion"} | details("its key is not known here", str(number)))
    rest = count.final_reports()
    assert rest[-1]["times"] == str(400 - MAX_KINDS)
    assert rest[-1]["reason"] == "its key is not known here"
