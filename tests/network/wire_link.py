"""A link in memory that drops, repeats and reorders at random."""

import random
from collections import deque
from typing import Generic, TypeVar

Item = TypeVar("Item")


class Link(Generic[Item]):
    """One direction of a bad link."""

    def __init__(self, chance: random.Random, drop: float = 0.0, repeat: float = 0.0, overtake: float = 0.0) -> None:
        self._chance, self._drop, self._repeat, self._overtake = chance, drop, repeat, overtake
        self._under_way: deque[Item] = deque()

    def send(self, item: Item) -> None:
        """Put something on the link, or lose it."""
        if self._chance.random() < self._drop:
            return
        for _ in range(2 if self._chance.random() < self._repeat else 1):
            if self._under_way and self._chance.random() < self._overtake:
                self._under_way.insert(self._chance.randrange(len(self._under_way)), item)
            else:
                self._under_way.append(item)

    def receive(self) -> Item | None:
        """Next that arrives, or None if nothing is under way."""
        return self._under_way.popleft() if self._under_way else None
