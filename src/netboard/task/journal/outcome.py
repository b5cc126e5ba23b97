"""The outcome of one attempt, as a journal tells it and as operators read it. It imports nothing but types."""

from typing import NamedTuple


class AttemptOutcome(NamedTuple):
    """One attempt, as in `netboard.network.protocol.control.Outcomes`."""

    block: int
    trial: int
    attempt: int
    outcome: str
    completion: float
    flags: str
    repeats: int

    @property
    def flag_list(self) -> tuple[str, ...]:
        """Quality flags of the attempt, in the order of `netboard.task.trials.quality.FLAGS`."""
        return tuple(filter(None, self.flags.split(",")))
