"""How often what was refused: each kind is reported when it first happens, then ever more seldom, and whole at the end.

A flood of refusals must cost neither the tick nor the recording: a report has the number of times so far, reports of
one kind are one second apart, then two, four and so on, and kinds beyond the first few hundred are counted together.
Pure: it is told the time.
"""

from collections.abc import Iterator
from dataclasses import dataclass

FIRST_WAIT_NS, LONGEST_WAIT_NS = 1_000_000_000, 64_000_000_000
"""The second report of a kind comes at least this long after the first; the wait doubles up to the longest [ns]."""

LOOK_NS = 100_000_000
MOST_REPORTS = 8
"""In each tenth of a second no more reports are made than this [1]."""

MOST_KINDS = 64
"""Kinds told apart [1]; beyond those, as many again by their channel and reason alone."""

MOST_REASONS = 32
"""Reasons told apart in the totals [1]."""

OTHERS = "others"
"""The peers of all further kinds."""

OTHER_REASONS = "other reasons"


@dataclass(slots=True)
class _Kind:
    """One kind of refusal: how often it has happened, and of how many of them a report has told."""

    details: dict[str, str]
    times: int = 0
    told: int = 0
    due_ns: int | None = None
    wait_ns: int = FIRST_WAIT_NS


class RefusalCount:
    """Counts refusals by kind."""

    def __init__(self) -> None:
        self.totals: dict[str, int] = {}
        self._kinds: dict[tuple[str, ...], _Kind] = {}
        self._untold: dict[int, _Kind] = {}
        self._look_ns: int | None = None
        self._reports = 0

    def count(self, kind: tuple[str, ...], details: dict[str, str], times: int = 1) -> None:
        """Count refusals of a kind; ``details`` say what it is, its ``reason`` among them."""
        reason = details["reason"]
        if reason not in self.totals and len(self.totals) >= MOST_REASONS:
            reason = OTHER_REASONS
        self.totals[reason] = self.totals.get(reason, 0) + times
        if kind not in self._kinds and len(self._kinds) >= MOST_KINDS:
            channel, reason = details.get("channel", ""), details["reason"]
            kind = OTHERS, channel, reason
            if kind not in self._kinds and len(self._kinds) >= 2 * MOST_KINDS:
                kind, reason = (OTHERS, channel), OTHER_REASONS
            details = {"channel": channel, "peer": OTHERS, "reason": reason}
        known = self._kinds.setdefault(kind, _Kind(details))
        known.times += times
        self._untold[id(known)] = known

    def reports(self, now_ns: int, *, again: bool = True) -> list[dict[str, str]]:
        """Take the reports that are due, with ``again`` those of known kinds too: details, and ``times`` so far."""
        if self._look_ns is None or now_ns >= self._look_ns:
            self._look_ns, self._reports = now_ns + LOOK_NS, 0
        elif self._reports >= MOST_REPORTS:
            return []
        due = [kind for kind in self._untold.values() if kind.due_ns is None or (again and now_ns >= kind.due_ns)]
        due = due[: MOST_REPORTS - self._reports]
        self._reports += len(due)
        for kind in due:
            kind.due_ns, kind.wait_ns = now_ns + kind.wait_ns, min(2 * kind.wait_ns, LONGEST_WAIT_NS)
        return list(self._told(due))

    def rest(self) -> list[dict[str, str]]:
        """Take the last reports: the final count of every kind that has grown since its last one."""
        return list(self._told(list(self._untold.values())))

    def _told(self, kinds: list[_Kind]) -> Iterator[dict[str, str]]:
        for kind in kinds:
            del self._untold[id(kind)]
            kind.told = kind.times
            yield {**kind.details, "times": str(kind.times)}
