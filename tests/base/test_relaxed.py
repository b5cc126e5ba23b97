"""Copies of strict kernels for fast ones: they replace what a kernel calls, and nothing else."""

from typing import NamedTuple

from netboard.base.compiled import relaxed


class Laws(NamedTuple):
    """A scene with an attribute that has the name of a function of this module."""

    friction: tuple[float, ...]


def coarse(value: float) -> float:
    return 10.0 * value


def fine(value: float) -> float:
    return value


def friction(laws: Laws) -> float:
    return _resistance(laws)


def _resistance(laws: Laws) -> float:
    return sum(fine(law) for law in laws.friction) + fine(laws.friction[0])


def fine_twice(value: float) -> float:
    return fine(value) + fine(value)


for kernel in (coarse, fine, friction, _resistance, fine_twice):
    kernel.__module__ = "netboard.kernels"  # others are not copied


def test_copy_calls_the_replacement_and_the_original_stays() -> None:
    copy = relaxed(fine_twice, {fine: coarse})
    assert (copy(1.0), fine_twice(1.0)) == (20.0, 2.0)


def test_attribute_with_the_name_of_a_function_is_not_taken_for_it() -> None:
    assert relaxed(friction, {})(Laws((1.0, 2.0))) == 4.0
