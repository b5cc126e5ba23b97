"""CRC-32 of a chunk, with carry-less multiplication where the processor has it.

Sixty-four bytes at a time are folded into the next sixty-four, which leaves the remainder of the message unchanged
(Gopal et al., Fast CRC computation for generic polynomials using PCLMULQDQ, Intel 2009). zlib computes the checksum of
what remains: the last block and the bytes behind it. The result is that of zlib, several times sooner.
"""

import zlib
from collections.abc import Sequence
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.core.base import BaseContext
from numba.core.registry import cpu_target
from numba.core.typing.context import Context
from numba.core.typing.templates import Signature
from numba.extending import intrinsic

from netboard.base.compiled import Bytes, Words, waiting

BLOCK = 64
"""Bytes that are folded at a time [1]."""

_LANES = BLOCK // 16
_FOLD = 0x154442BD4, 0x1C6E41596
"""Powers of x modulo the polynomial, bits reflected: x^(512 + 32) and x^(512 - 32), by which a lane moves one block."""

_START = 0xFFFFFFFF
"""State before the first byte, and what zlib must be given to begin with the state 0 [1]."""

_TOOLS: Any = cgutils  # which has no types

_PAIR = ir.VectorType(ir.IntType(64), 2)


def _has_multiplication() -> bool:
    """Return whether kernels are compiled for a processor with carry-less multiplication."""
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
        return False
    triple, _, features = cpu_target.target_context.codegen().magic_tuple()
    return str(triple).startswith("x86_64") and "+pclmul" in str(features).split(",")


IS_FAST = _has_multiplication()
"""Whether the checksum is folded before zlib sees it."""


def crc32(data: bytes) -> int:
    """Return the CRC-32 of some bytes, as `zlib.crc32` does."""
    blocks = len(data) // BLOCK
    if not IS_FAST or blocks < 2:
        return zlib.crc32(data)
    last = np.empty(BLOCK // 8, np.int64)
    _folded(np.frombuffer(data, np.uint8), blocks, last)
    return zlib.crc32(memoryview(data)[blocks * BLOCK :], zlib.crc32(last.tobytes(), _START))


@waiting
def _folded(data: Bytes, blocks: int, last: Words) -> None:
    """Write a block with the remainder of the first blocks of the data, of which there are two or more."""
    _fold(data, blocks, last)


def _folding(typing: Context, data: types.Type, blocks: types.Type, last: types.Type) -> Any:
    """Fold all blocks into the last one."""

    def write(context: BaseContext, builder: ir.IRBuilder, signature: Signature, arguments: Sequence[ir.Value]) -> Any:
        source, count, target = arguments
        start, end = (
            _TOOLS.create_struct_proxy(kind)(context, builder, array).data
            for kind, array in ((signature.args[0], source), (signature.args[2], target))
        )
        end = builder.bitcast(end, _PAIR.as_pointer())
        lanes = [_TOOLS.alloca_once_value(builder, _lane(builder, start, k)) for k in range(_LANES)]
        first = builder.insert_element(_pair(0, 0), ir.Constant(ir.IntType(64), _START), ir.Constant(ir.IntType(32), 0))
        builder.store(builder.xor(builder.load(lanes[0]), first), lanes[0])
        one = ir.Constant(count.type, 1)
        with _TOOLS.for_range_slice(builder, one, count, one) as (block, _):
            place = builder.gep(start, [builder.mul(block, ir.Constant(count.type, BLOCK))])
            for k, lane in enumerate(lanes):
                builder.store(builder.xor(_moved(builder, builder.load(lane)), _lane(builder, place, k)), lane)
        for k, lane in enumerate(lanes):
            builder.store(builder.load(lane), builder.gep(end, [ir.Constant(ir.IntType(32), k)]), align=8)
        return ir.Constant(ir.IntType(8).as_pointer(), None)

    return types.void(data, blocks, last), write


_fold: Any = intrinsic(_folding)


def _pair(low: int, high: int) -> ir.Constant:
    return ir.Constant(_PAIR, [low, high])


def _lane(builder: ir.IRBuilder, start: ir.Value, k: int) -> ir.Value:
    """Load sixteen bytes of a block."""
    place = builder.gep(start, [ir.Constant(ir.IntType(64), 16 * k)])
    return builder.load(builder.bitcast(place, _PAIR.as_pointer()), align=1)


def _moved(builder: ir.IRBuilder, lane: ir.Value) -> ir.Value:
    """Multiply a lane by the power of x that moves it one block."""
    kind = ir.FunctionType(_PAIR, [_PAIR, _PAIR, ir.IntType(8)])
    multiply = _TOOLS.get_or_insert_function(builder.module, kind, "llvm.x86.pclmulqdq")
    power = _pair(*_FOLD)
    low, high = (builder.call(multiply, [lane, power, ir.Constant(ir.IntType(8), half)]) for half in (0x00, 0x11))
    return builder.xor(low, high)
