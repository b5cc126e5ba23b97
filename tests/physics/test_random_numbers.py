"""Random numbers of kernels, against NumPy's own."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest

from netboard.base.compiled import kernel
from netboard.physics.arithmetic.random_numbers import _advanced, coin, normal, pack_stream


@kernel
def draw(stream: Any, tosses: Any, coins: Any, normals: Any) -> None:
    """Toss a number of coins before each normal number."""
    tossed = 0
    for k in range(len(normals)):
        for _ in range(tosses[k]):
            coins[tossed] = coin(stream)
            tossed += 1
        normals[k] = normal(stream)


def drawn(rng: np.random.Generator, tosses: Sequence[int]) -> tuple[list[int], list[float]]:
    coins, normals = np.zeros(sum(tosses), np.int64), np.zeros(len(tosses))
    draw(pack_stream(rng)[0], np.array(tosses), coins, normals)
    return coins.tolist(), normals.tolist()


def drawn_by_numpy(rng: np.random.Generator, tosses: Sequence[int]) -> tuple[list[int], list[float]]:
    coins, normals = [], []
    for count in tosses:
        coins += [int(rng.integers(0, 2)) for _ in range(count)]
        normals.append(rng.standard_normal())
    return coins, normals


@pytest.mark.parametrize("seed", range(4))
def test_numbers_are_those_of_numpy_to_the_bit(seed: int) -> None:
    tosses = [k % 4 for k in range(50_000)]
    assert drawn(np.random.default_rng(seed), tosses) == drawn_by_numpy(np.random.default_rng(seed), tosses)


def test_a_stream_goes_on_where_its_generator_was() -> None:
    rng = np.random.default_rng(7)
    rng.standard_normal(10)
    rng.integers(0, 2)  # leaves half of its bits for the next call
    assert drawn(rng, [1, 0, 2]) == drawn_by_numpy(rng, [1, 0, 2])


def test_numbers_beyond_the_edge_of_the_outermost_layer_are_drawn_too() -> None:
    _, normals = drawn(np.random.default_rng(1), [0] * 50_000)
    assert max(map(abs, normals)) > 3.66


def test_plain_python_steps_as_numpy_does() -> None:
    rng = np.random.default_rng(3)
    high, low, *step = (int(pack_stream(rng)[0][name]) for name in ("high", "low", "step_high", "step_low"))
    for expected in rng.bit_generator.random_raw(1000):
        high, low, bits = _advanced(high, low, *step)
        assert bits % 2**64 == expected
    assert (high, low) == tuple(pack_stream(rng)[0][["high", "low"]])


def test_another_kind_of_generator_is_refused() -> None:
    with pytest.raises(ValueError, match="expected a generator of the kind PCG64, not MT19937"):
        pack_stream(np.random.Generator(np.random.MT19937(1)))
