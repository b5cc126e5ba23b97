"""Counts of refusals by kind, reported when a kind first occurs, then less and less often, and finally in full.

A flood of refusals must cost neither the tick nor the recording. A report has the count so far. Reports of one kind are
one second apart, then two, four and so on. Kinds beyond the first `MAX_KINDS` are counted by channel and reason alone.
Pure: time is an argument.
"""

from collections.abc import Iterator
from dataclasses import dataclass

FIRST_WAIT_NS, MAX_WAIT_NS = 1_000_000_000, 64_000_000_000
"""Wait between the first two reports of a kind; it doubles up to the longest [ns]."""

CHECK_INTERVAL_NS = 100_000_000
MAX_REPORTS = 8
"""Largest number of reports in each tenth of a second [1]."""

MAX_KINDS = 64
"""Kinds counted separately; beyond those, as many again by channel and reason alone [1]."""

MAX_REASONS = 32
"""Reasons counted separately in the totals [1]."""

OTHERS = "others"
"""Stands for the peers of all further kinds."""

OTHER_REASONS = "other reasons"


@dataclass(slots=True)
class _Kind:
    """One kind of refusal: its count, when its next report is due, and the wait after that one."""

    details: dict[str, str]
    times: int = 0
    due_ns: int | None = None  # None before the first report
    wait_ns: int = FIRST_WAIT_NS


class RefusalCounter:
    """Counts refusals by kind."""

    def __init__(self) -> None:
        self.totals: dict[str, int] = {}
        self._kinds: dict[tuple[str, ...], _Kind] = {}
        self._unreported: dict[int, _Kind] = {}
        self._next_check_ns: int | None = None
        self._reports = 0

    def count(self, kind: tuple[str, ...], details: dict[str, str], times: int = 1) -> None:
        """Count refusals of a kind; ``details`` describe it, including its ``reason``."""
        reason = details["reason"]
        if reason not in self.totals and len(self.totals) >= MAX_REASONS:
            reason = OTHER_REASONS
        self.totals[reason] = self.totals.get(reason, 0) + times
        if kind not in self._kinds and len(self._kinds) >= MAX_KINDS:
            channel, reason = details.get("channel", ""), details["reason"]
            kind = OTHERS, channel, reason
            if kind not in self._kinds and len(self._kinds) >= 2 * MAX_KINDS:
                kind, reason = (OTHERS, channel), OTHER_REASONS
            details = {"channel": channel, "peer": OTHERS, "reason": reason}
        known = self._kinds.setdefault(kind, _Kind(details))
        known.times += times
        self._unreported[id(known)] = known

    def reports(self, now_ns: int, *, again: bool = True) -> list[dict[str, str]]:
        """Return the reports that are due, with ``again`` those of known kinds too: details, and ``times`` so far."""
        if self._next_check_ns is None or now_ns >= self._next_check_ns:
            self._next_check_ns, self._reports = now_ns + CHECK_INTERVAL_NS, 0
        elif self._reports >= MAX_REPORTS:
            return []
        due = [kind for kind in self._unreported.values() if kind.due_ns is None or (again and now_ns >= kind.due_ns)]
        due = due[: MAX_REPORTS - self._reports]
        self._reports += len(due)
        for kind in due:
            kind.due_ns, kind.wait_ns = now_ns + kind.wait_ns, min(2 * kind.wait_ns, MAX_WAIT_NS)
        return list(self._report(due))

    def final_reports(self) -> list[dict[str, str]]:
        """Return the final count of every kind that has grown since its last report."""
        return list(self._report(list(self._unreported.values())))

    def _report(self, kinds: list[_Kind]) -> Iterator[dict[str, str]]:
        for kind in kinds:
            del self._unreported[id(kind)]
            yield {**kind.details, "times": str(kind.times)}
