"""A link in memory that drops, repeats and reorders at random."""

import random
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Link(Generic[Item]):
    """One direction of an unreliable link."""

    def __init__(self, rng: random.Random, drop: float = 0.0, repeat: float = 0.0, overtake: float = 0.0) -> None:
        self._rng, self._drop, self._repeat, self._overtake = rng, drop, repeat, overtake
        self._in_flight: deque[Item] = deque()

    def send(self, item: Item) -> None:
        """Send an item, unless it is dropped."""
        if self._rng.random() < self._drop:
            return
        for _ in range(2 if self._rng.random() < self._repeat else 1):
            if self._in_flight and self._rng.random() < self._overtake:
                self._in_flight.insert(self._rng.randrange(len(self._in_flight)), item)
            else:
                self._in_flight.append(item)

    def receive(self) -> Item | None:
        """Next item to arrive, or None if none is in flight."""
        return self._in_flight.popleft() if self._in_flight else None
