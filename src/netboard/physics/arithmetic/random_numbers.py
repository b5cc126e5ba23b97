"""Random numbers for kernels: to the bit those of `standard_normal` and ``integers(0, 2)`` of NumPy's generator.

Numba calls NumPy's generator through a pointer for each number. Here a draw is compiled into the kernel, so that it
runs beside other operations. The bits are those of PCG64, a linear congruential generator modulo 2^128 with a permuted
output (O'Neill, HMC-CS-2014-0905), and the numbers those of the ziggurat: of 256 layers under the normal density
(Marsaglia and Tsang, J. Stat. Softw. 5:8, 2000), one is drawn, and a place in it, which nearly always lies inside.

Rule 1: a `STREAM` goes on where its generator was when it was packed; the generator itself stays there.
"""

from collections.abc import Sequence
from math import exp, log1p
from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.base import BaseContext
from numba.core.typing.context import Context
from numba.core.typing.templates import Signature
from numba.extending import intrinsic
from numba.np.random import _constants as ziggurat
from numpy.typing import NDArray

from netboard.base.compiled import inlined, kernel, specialised

STREAM = np.dtype([("high", "<i8"), ("low", "<i8"), ("step_high", "<i8"), ("step_low", "<i8"), ("rest", "<i8")])
"""State and increment of a PCG64, as halves of 128-bit integers, and unused bits: 32 of them, or -1 for none."""

_MULTIPLIER = 0x2360ED051FC65DA44385DF649FCCF645
_WORD, _HALF = 2**64 - 1, 2**32 - 1

_SIZE = 2**52 - 1  # the bits of a place in a layer
_INSIDE = ziggurat.ki_double.astype(np.int64)  # places below these are under the density for sure
_DENSITY = ziggurat.fi_double  # at the outer edge of each layer, times sqrt(2 pi)
_WIDTH = np.concatenate([ziggurat.wi_double, -ziggurat.wi_double])  # width of a place: on the right, then on the left
_TAIL = ziggurat.ziggurat_nor_r  # where the tail begins
_PER_TAIL = ziggurat.ziggurat_nor_inv_r


def pack_stream(rng: np.random.Generator) -> NDArray[Any]:
    """Return the numbers that a generator would draw next, as an ndarray of STREAM, shape (1,) [1].

    Parameters
    ----------
    rng : numpy.random.Generator
        It is not advanced.

    Raises
    ------
    ValueError
        If it is not the default kind of generator.
    """
    state = rng.bit_generator.state
    if state["bit_generator"] != "PCG64":
        raise ValueError(f"expected a generator of the kind PCG64, not {state['bit_generator']}")
    packed = np.zeros(1, STREAM)
    for high, low, value in (
        ("high", "low", state["state"]["state"]),
        ("step_high", "step_low", state["state"]["inc"]),
    ):
        packed[high], packed[low] = _signed(value >> 64), _signed(value & _WORD)
    packed["rest"] = state["uinteger"] if state["has_uint32"] else -1
    return packed


def _signed(word: int) -> int:
    """Return the signed integer with the bits of an unsigned one."""
    return word - 2**64 if word >> 63 else word


def _advanced(high: int, low: int, step_high: int, step_low: int) -> tuple[int, int, int]:
    """Return the next state of a PCG64, as two halves, and its random bits, as signed integers [1]."""
    state, step = (int(upper) << 64 | int(lower) & _WORD for upper, lower in ((high, low), (step_high, step_low)))
    state = state * _MULTIPLIER + step
    upper, lower = state >> 64 & _WORD, state & _WORD
    mixed, turn = upper ^ lower, upper >> 58
    bits = (mixed >> turn | mixed << (64 - turn)) & _WORD
    return _signed(upper), _signed(lower), _signed(bits)


def _stepping(typing: Context, high: types.Type, low: types.Type, step_high: types.Type, step_low: types.Type) -> Any:
    result, word, wide = types.UniTuple(types.int64, 3), ir.IntType(64), ir.IntType(128)

    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        state, step = (
            builder.or_(builder.shl(builder.zext(upper, wide), wide(64)), builder.zext(lower, wide))
            for upper, lower in (args[:2], args[2:])
        )
        state = builder.add(builder.mul(state, wide(_MULTIPLIER)), step)
        upper, lower = builder.trunc(builder.lshr(state, wide(64)), word), builder.trunc(state, word)
        mixed = builder.xor(upper, lower)
        turn = cgutils.get_or_insert_function(builder.module, ir.FunctionType(word, [word] * 3), "llvm.fshr.i64")
        bits = builder.call(turn, [mixed, mixed, builder.lshr(upper, word(58))])
        return context.make_tuple(builder, result, [upper, lower, bits])

    return result(high, low, step_high, step_low), write


_stepped: Any = intrinsic(_stepping)


@specialised(_advanced)
def _choose(high: types.Type, low: types.Type, step_high: types.Type, step_low: types.Type) -> Any:
    return lambda high, low, step_high, step_low: _stepped(high, low, step_high, step_low)


@inlined
def _next_bits(stream: np.void) -> int:
    """Return the next 64 random bits of a stream, as a signed integer."""
    stream["high"], stream["low"], bits = _advanced(
        stream["high"], stream["low"], stream["step_high"], stream["step_low"]
    )
    return bits


@inlined
def _uniform(stream: np.void) -> float:
    """Return the next number of a stream that is uniform in [0, 1)."""
    return (_next_bits(stream) >> 11 & 2**53 - 1) * 2.0**-53


@inlined
def normal(stream: np.void) -> float:
    """Return the next standard normal number of a stream, a record of STREAM [1]."""
    bits = _next_bits(stream)
    place = bits >> 9 & _SIZE
    if place < _INSIDE[bits & 255]:
        return float(place * _WIDTH[bits & 511])
    return _normal_of(stream, bits)


@inlined
def coin(stream: np.void) -> int:
    """Return 0 or 1, as ``Generator.integers(0, 2)`` does, which keeps half of the bits for its next call [1]."""
    half = stream["rest"]
    stream["rest"] = -1
    if half < 0:
        bits = _next_bits(stream)
        half, stream["rest"] = bits & _HALF, bits >> 32 & _HALF
    return int(half >> 31)


@kernel
def _normal_of(stream: np.void, bits: int) -> float:
    """Return the number that these bits begin; more are drawn if it is near or beyond the edge of its layer."""
    while True:
        layer, place = bits & 255, bits >> 9 & _SIZE
        number = place * _WIDTH[bits & 511]
        if place < _INSIDE[layer]:
            return float(number)
        if layer == 0:
            return _tail(stream, place)
        lower, upper = _DENSITY[layer], _DENSITY[layer - 1]
        if (upper - lower) * _uniform(stream) + lower < exp(-0.5 * number * number):
            return float(number)
        bits = _next_bits(stream)


@inlined
def _tail(stream: np.void, place: int) -> float:
    """Return a number from the tail (Marsaglia 1964), on the side that a bit of the place gives."""
    while True:
        beyond, other = -_PER_TAIL * log1p(-_uniform(stream)), -log1p(-_uniform(stream))
        if other + other > beyond * beyond:
            return float(-(_TAIL + beyond) if place >> 8 & 1 else _TAIL + beyond)
