"""Vector registers (SIMD) as a type for kernels: several floats with element-wise arithmetic.

Whether a compiler vectorises a loop is uncertain; lanes always compile to vector instructions. They are loaded from
arrays and tuples and stored there. +, -, *, /, abs and sqrt with lanes and floats give the same bits as floats do, so
the code of `netboard.physics.scene.models` compiles for them unchanged. In plain Python lanes are small NumPy arrays.

Numba has no such type, so this module generates LLVM instructions.
"""

import inspect
import math
import operator
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.base import BaseContext
from numba.core.datamodel.manager import DataModelManager
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.context import Context
from numba.core.typing.templates import AbstractTemplate, Signature, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, register_model
from numpy.typing import NDArray

from netboard.base.compiled import specialised
from netboard.physics.arithmetic.vectors import State

Array = NDArray[np.float64]

Packed = Array | float
"""Lanes, or a number that stands for lanes that are all equal to it."""

_DOUBLE = ir.DoubleType()
_INT = ir.IntType(32)


class Lanes(types.Type):
    """A vector of float64.

    Parameters
    ----------
    count : int
        Number of lanes; powers of two are fastest [1].
    """

    def __init__(self, count: int) -> None:
        """Set the name by which Numba identifies the type."""
        self.count = count
        super().__init__(name=f"lanes({count})")

    def can_convert_from(self, typingctx: Context, other: types.Type) -> Any:
        """Convert a number to lanes that are all equal to it.

        Parameters
        ----------
        typingctx : object
            Numba's typing context, unused.
        other : type
            Numba's type of the number.
        """
        return Conversion.safe if isinstance(other, types.Float | types.Integer) else None


def _make_model(manager: DataModelManager, lanes: Lanes) -> Any:
    return models.PrimitiveModel(manager, lanes, ir.VectorType(_DOUBLE, lanes.count))


register_model(Lanes)(_make_model)


def _spread_value(builder: ir.IRBuilder, value: ir.Value, count: int) -> Any:
    """Broadcast a float to all lanes."""
    vector = ir.VectorType(_DOUBLE, count)
    first = builder.insert_element(ir.Constant(vector, ir.Undefined), value, _INT(0))
    return _spread_lane(builder, first, 0, count)


def _spread_lane(builder: ir.IRBuilder, lanes: ir.Value, i: int, count: int) -> Any:
    """Broadcast one lane to all lanes."""
    mask = ir.Constant(ir.VectorType(_INT, count), [i] * count)
    return builder.shuffle_vector(lanes, ir.Constant(lanes.type, ir.Undefined), mask)


def _cast(context: BaseContext, builder: ir.IRBuilder, source: types.Type, target: Lanes, value: ir.Value) -> Any:
    return _spread_value(builder, context.cast(builder, value, source, types.float64), target.count)


lower_cast(types.Float, Lanes)(_cast)
lower_cast(types.Integer, Lanes)(_cast)


class _Arithmetic(AbstractTemplate):
    """Typing of arithmetic between lanes, or lanes and numbers."""

    def generic(self, args: Sequence[types.Type], kws: Mapping[str, types.Type]) -> Any:
        """Return the signature for the given types."""
        found = [a for a in args if isinstance(a, Lanes)]
        if not found or not all(a == found[0] or isinstance(a, types.Float | types.Integer) for a in args):
            return None
        return signature(found[0], *[found[0]] * len(args))


def _define(operation: Callable[..., Any], instruction: Callable[..., Any], operands: int) -> None:
    """Implement a Python function for lanes by an instruction."""

    def lower(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        return instruction(builder, *args)

    infer_global(operation)(type(f"_{operation.__name__}", (_Arithmetic,), {}))
    lower_builtin(operation, *[Lanes] * operands)(lower)


def _intrinsic(name: str) -> Callable[..., Any]:
    """Return a generator of an LLVM intrinsic that is exact or correctly rounded."""

    def write(builder: ir.IRBuilder, value: ir.Value) -> Any:
        of_lanes = f"llvm.{name}.v{value.type.count}f64"
        return builder.call(
            builder.module.declare_intrinsic(of_lanes, (), ir.FunctionType(value.type, [value.type])), [value]
        )

    return write


def larger(one: Packed, other: Packed) -> Any:
    """Return the larger of two in each lane, as ``max(one, other)`` does."""
    return np.where(other > one, other, one)


def smaller(one: Packed, other: Packed) -> Any:
    """Return the smaller of two in each lane, as ``min(one, other)`` does."""
    return np.where(other < one, other, one)


def where_within(lanes: Packed, low: Packed, high: Packed, inside: Packed, outside: Packed) -> Any:
    """Return ``inside`` in each lane whose number lies between its bounds or on them, and ``outside`` elsewhere.

    NaN counts as inside, so that it is passed on as by arithmetic.

    Parameters
    ----------
    low, high : lanes
        Bounds, in the unit of the lanes.
    inside, outside : lanes
        Results, in any unit.
    """
    return np.where((lanes < low) | (lanes > high), outside, inside)


def _choice(comparison: str) -> Callable[..., Any]:
    """Return a generator of a choice between two lanes, which compares as Python's max and min do."""

    def write(builder: ir.IRBuilder, one: ir.Value, other: ir.Value) -> Any:
        return builder.select(builder.fcmp_ordered(comparison, other, one), other, one)

    return write


def _write_within(
    builder: ir.IRBuilder, value: ir.Value, low: ir.Value, high: ir.Value, inside: ir.Value, outside: ir.Value
) -> Any:
    above, below = (builder.fcmp_ordered("<", one, other) for one, other in ((high, value), (value, low)))
    return builder.select(builder.or_(above, below), outside, inside)


_BUILDER = ir.IRBuilder
for _name, _instruction in (
    ("add", _BUILDER.fadd),
    ("sub", _BUILDER.fsub),
    ("mul", _BUILDER.fmul),
    ("truediv", _BUILDER.fdiv),
):
    _define(getattr(operator, _name), _instruction, 2)
    _define(getattr(operator, f"i{_name}"), _instruction, 2)
_define(operator.neg, _BUILDER.fneg, 1)
_define(math.sqrt, _intrinsic("sqrt"), 1)
_define(abs, _intrinsic("fabs"), 1)
_define(larger, _choice(">"), 2)
_define(smaller, _choice("<"), 2)
_define(where_within, _write_within, 5)


def _element(
    context: BaseContext, builder: ir.IRBuilder, array_type: types.Type, array: ir.Value, offset: ir.Value
) -> Any:
    """Generate the address of an element of an array, by its flat index."""
    structure = cgutils.create_struct_proxy(array_type)(context, builder, array)
    return builder.gep(structure.data, [offset])


def _load(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value], count: int) -> Any:
    place = _element(context, builder, sig.args[0], args[0], context.cast(builder, args[1], sig.args[1], types.intp))
    pointer = builder.bitcast(place, ir.VectorType(_DOUBLE, count).as_pointer())
    return builder.load(pointer, align=8)


def _loading(typing: Context, array: types.Type, offset: types.Type, count: types.IntegerLiteral) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        return _load(context, builder, sig, args, count.literal_value)

    return Lanes(count.literal_value)(array, types.intp, count), write


def _pairing(typing: Context, array: types.Type, offset: types.Type, count: types.IntegerLiteral) -> Any:
    n = count.literal_value
    result = types.UniTuple(Lanes(n), 2)

    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        both = _load(context, builder, sig, args, 2 * n)
        masks = [ir.Constant(ir.VectorType(_INT, n), list(range(side, 2 * n, 2))) for side in (0, 1)]
        parts = [builder.shuffle_vector(both, ir.Constant(both.type, ir.Undefined), mask) for mask in masks]
        return context.make_tuple(builder, result, parts)

    return result(array, types.intp, count), write


def _storing(typing: Context, array: types.Type, offset: types.Type, lanes: Lanes) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        place = _element(context, builder, sig.args[0], args[0], args[1])
        builder.store(args[2], builder.bitcast(place, args[2].type.as_pointer()), align=8)
        return context.get_dummy_value()

    return types.none(array, types.intp, lanes), write


def _extracting(typing: Context, lanes: Lanes, i: types.Type) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        return builder.extract_element(args[0], context.cast(builder, args[1], sig.args[1], types.int32))

    return types.float64(lanes, types.intp), write


def _spreading(typing: Context, lanes: Lanes, i: types.IntegerLiteral) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        return _spread_lane(builder, args[0], i.literal_value, lanes.count)

    return lanes(lanes, i), write


def _gathering(typing: Context, values: types.UniTuple, count: types.IntegerLiteral) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        vector = ir.Constant(ir.VectorType(_DOUBLE, count.literal_value), [0.0] * count.literal_value)
        for i in range(values.count):
            vector = builder.insert_element(vector, builder.extract_value(args[0], i), _INT(i))
        return vector

    return Lanes(count.literal_value)(values, count), write


def _rounding(typing: Context, lanes: Lanes) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        return builder.fadd(_intrinsic("rint")(builder, args[0]), ir.Constant(args[0].type, [0.0] * lanes.count))

    return lanes(lanes), write


def _bounding(typing: Context, lanes: Lanes, bound: types.Type) -> Any:
    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        n = lanes.count
        high = _spread_value(builder, args[1], n)
        low = _spread_value(builder, builder.fneg(args[1]), n)
        inside = builder.and_(builder.fcmp_ordered("<=", args[0], high), builder.fcmp_ordered(">=", args[0], low))
        bits = builder.bitcast(inside, ir.IntType(n))
        return builder.icmp_unsigned("==", bits, ir.Constant(ir.IntType(n), -1))

    return types.boolean(lanes, types.float64), write


def _applying(typing: Context, array: types.Type, offset: types.Type, lanes: Lanes, count: types.IntegerLiteral) -> Any:
    n = count.literal_value

    def write(context: BaseContext, builder: ir.IRBuilder, sig: Signature, args: Sequence[ir.Value]) -> Any:
        pointer = ir.VectorType(_DOUBLE, n).as_pointer()
        start = context.cast(builder, args[1], sig.args[1], types.intp)
        chains: list[Any] = []  # two, which the processor adds up side by side
        for j in range(lanes.count):
            place = _element(context, builder, array, args[0], builder.add(start, ir.Constant(start.type, j * n)))
            column = builder.load(builder.bitcast(place, pointer), align=8)
            product = builder.fmul(column, _spread_lane(builder, args[2], j, n))
            if j < 2:
                chains.append(product)
            else:
                chains[j % 2] = builder.fadd(chains[j % 2], product)
        return builder.fadd(*chains)

    return Lanes(n)(array, types.intp, lanes, count), write


def lanes_at(array: Array, offset: int, count: int) -> Any:
    """Load consecutive elements of an array."""
    return array.ravel()[offset : offset + count].copy()


def pair_at(array: Array, offset: int, count: int) -> tuple[Any, Any]:
    """Load two registers whose elements alternate in an array, each of `count` lanes."""
    both = array.ravel()[offset : offset + 2 * count]
    return both[::2], both[1::2]


def put(array: Array, offset: int, lanes: Packed) -> None:
    """Store lanes in an array."""
    array.ravel()[offset : offset + np.size(lanes)] = lanes


def lane(lanes: Array, i: int) -> float:
    """Return lane i, in the unit of the lanes [1]."""
    return float(lanes[i])


def spread(lanes: Array, i: int) -> Any:
    """Return lanes that are all equal to lane i."""
    return np.full(len(lanes), lanes[i])


def gathered(values: State, count: int) -> Any:
    """Return the floats of a tuple as lanes, followed by zeros.

    Parameters
    ----------
    values : tuple of float
        At most `count` numbers.
    """
    return np.array([*values, *[0.0] * (count - len(values))])


def nearest(lanes: Array) -> Any:
    """Return the nearest whole number in each lane, the even one of two, as ``round`` does; never -0.0."""
    return np.rint(lanes) + 0.0


def within(lanes: Array, bound: float) -> bool:
    """Return whether the magnitude of every lane is at most a bound; False if any is NaN.

    Parameters
    ----------
    bound : float
        Largest magnitude, in the unit of the lanes [1].
    """
    return bool((np.abs(lanes) <= bound).all())


def applied(array: Array, offset: int, lanes: Array, count: int) -> Any:
    """Return the product of a matrix and lanes.

    The array holds the columns of the matrix, one for each lane, each of `count` rows.
    """
    columns = array.ravel()[offset : offset + len(lanes) * count].reshape(len(lanes), count)
    chains = [columns[0] * lanes[0], columns[1] * lanes[1]]
    for j in range(2, len(lanes)):
        chains[j % 2] = chains[j % 2] + columns[j] * lanes[j]
    return chains[0] + chains[1]


def _is(plain: Callable[..., Any], instructions: Callable[..., Any]) -> None:
    """Let numba write some instructions in place of a function; not for arrays whose elements are not in C order."""
    names = ", ".join(inspect.signature(plain).parameters)
    text = eval(f"lambda {names}: instructions({names})", {"instructions": instructions, "__name__": __name__})

    def choose(*arguments: types.Type) -> Any:
        return None if any(isinstance(a, types.Array) and a.layout != "C" for a in arguments) else text

    specialised(plain)(eval(f"lambda {names}: choose({names})", {"choose": choose}))


for _plain, _writer in (
    (lanes_at, _loading),
    (pair_at, _pairing),
    (put, _storing),
    (lane, _extracting),
    (spread, _spreading),
    (gathered, _gathering),
    (nearest, _rounding),
    (within, _bounding),
    (applied, _applying),
):
    _is(_plain, intrinsic(prefer_literal=True)(_writer))
