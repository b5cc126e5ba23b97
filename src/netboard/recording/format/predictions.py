"""Predictions of columns by other columns of the same batch; a batch stores the prediction errors.

Much of a tick follows from the rest of it: the extrapolated stylus from its sample, the coupling force from stylus and
board, velocities from neighbouring positions, the state before a tick from the tick before. `PREDICTIONS` states how,
as expressions in Python and numpy, in the order in which they are evaluated. The schema of a recording lists them, so a
reader needs nothing else.

They are part of the format, not of the stage, and stay as they are if the stage changes. A wrong prediction costs
bytes, never a bit. Every machine must compute the same bits, therefore expressions use only ``+ - * /``, comparisons,
negation and ``np.where``, and a value that is not finite predicts 0 (NaN has different bits on different machines).
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import Config
from netboard.base.errors import RecordingError
from netboard.base.tick import TICK

CONSTANTS = ("l", "left_k", "left_c", "right_k", "right_c", "left_felt", "right_felt", "moves", "bends")
"""Numbers of a block that predictions use; each batch has them.

Half the length of the board [m]; stiffness [N/m] and damping [N s/m] of each coupling; factor of the full force on each
hand, 0 for any other force condition [1]; 1 if velocity extrapolates a stylus sample, 1 if acceleration does [1].
"""

UNKNOWN = dict.fromkeys(CONSTANTS, 0.0)
"""Constants of a block whose configuration is lost."""

_SLOPE = "((after({0}) - before({0})) * 8.0 - (after(after({0})) - before(before({0})))) * 83.33333333333333"

_VELOCITIES = {  # central differences of the neighbouring ticks, in SI units
    velocity: _SLOPE.format(position) for velocity, position in (("vz", "z"), ("omega", "theta"), ("vp", "p"))
}

_SINE = {  # fdlibm's polynomials for small angles, in the order of the stage's arithmetic
    "zz": "theta * theta",
    "ww": "zz * zz",
    "vv": "zz * theta",
    "sine": "theta - (zz * (0.0 - vv * (8.33333333332248946124e-03 + zz * (-1.98412698298579493134e-04"
    " + zz * 2.75573137070700676789e-06) + zz * ww * (-2.50507602534068634195e-08"
    " + zz * 1.58969099521155010221e-10))) - vv * -1.66666666666666324348e-01)",
    "half": "0.5 * zz",
    "top": "1.0 - half",
    "cosine": "top + (((1.0 - top) - half) + zz * (zz * (4.16666666666666019037e-02 + zz * (-1.38888888888741095749e-03"
    " + zz * 2.48015872894767294178e-05)) + ww * ww * (-2.75573143513906633035e-07"
    " + zz * (2.08757232129817482790e-09 + zz * -1.13596475577881948265e-11))))",
    "arm": "l * sine",
    "arm_rate": "l * omega * cosine",
}

_OF_A_SIDE = {
    "{}_stamp_ns": "time_ns",
    "{}_lead_ns": "time_ns - {}_stamp_ns",
    # The state of a side before a tick is what the tick before has left.
    "{}_seen_ns": "before({}_stamp_ns)",
    "{}_seen_vz": "before({}_sent_vz)",
    "{}_gap": "({}_stamp_ns - {}_seen_ns) * 1e-9",
    "{}_slope": "np.where(({}_gap >= 0.25e-3) & ({}_gap <= 5e-3), ({}_sent_vz - {}_seen_vz) / {}_gap, 0.0)",
    "{}_az": "before({}_slope)",
    # Extrapolation of the sample to the tick.
    "{}_age": "(time_ns - {}_stamp_ns) * 1e-9 * moves",
    "{}_used_az": "np.where({}_stamp_ns == {}_seen_ns, {}_az, {}_slope) * bends",
    "{}_used_vz": "{}_sent_vz + {}_used_az * {}_age",
    "{}_used_z": "{}_sent_z + {}_sent_vz * {}_age + 0.5 * {}_used_az * ({}_age * {}_age)",
    "{}_z": "before({}_used_z)",
    "{}_coupling": "{}_k * {}_used_z + {}_c * {}_used_vz - ({}_k * (z SIGN arm) + {}_c * (vz SIGN arm_rate))",
    "{}_force": "np.where(({}_felt != 0.0) & (phase > 0) & (phase < 6), -({}_felt * {}_coupling), 0.0)",
    "{}_rendered": "before({}_force)",
}


def _of(side: str, sign: str) -> dict[str, str]:
    return {name.format(side): text.replace("{}", side).replace("SIGN", sign) for name, text in _OF_A_SIDE.items()}


PREDICTIONS: dict[str, str] = {
    **_VELOCITIES,
    **_SINE,
    **_of("left", "-"),
    **_of("right", "+"),
    # A tick begins when the second sample has arrived.
    "late_ns": "np.where(left_lead_ns < right_lead_ns, -left_lead_ns, -right_lead_ns)",
}
"""Expressions of predicted columns, and of intermediate values, by name, in the order of their evaluation."""

_ALWAYS = ("np", "where", "before", "after")
_CODE = {text: compile(text, name, "eval") for name, text in PREDICTIONS.items()}


def constants_of(config: Config) -> dict[str, float]:
    """Return the constants of a block."""
    physics, block = config.physics, config.block
    scale = block.force_scale if block.force == "full" else 0.0
    found = {"l": physics.l, "moves": float(physics.hold != "zoh"), "bends": float(physics.hold == "ca")}
    for side, mover in (("left", block.left), ("right", block.right)):
        holds = physics.coupling in (side, "both")
        found[f"{side}_k"], found[f"{side}_c"] = (physics.k_h, physics.c_h) if holds else (0.0, 0.0)
        found[f"{side}_felt"] = 0.0 if mover == "still" else scale
    return found


def require_known(predictions: Mapping[str, str], given: Iterable[str]) -> dict[str, str]:
    """Return the predictions of a file's schema; refuse those that this version does not have, or cannot evaluate.

    ``given``: names of the file's columns and constants. A reader must never execute a text from a file.
    """
    there = {*given, *_ALWAYS}
    for name, text in predictions.items():
        if name in _ALWAYS:
            raise RecordingError(f"its schema predicts {name}, which is a function of the predictions")
        if text not in _CODE:
            raise RecordingError(f"its column {name} is predicted as {text!r:.100}, which this version does not know")
        if missing := uses(text) - there:
            raise RecordingError(f"its column {name} is predicted from {', '.join(sorted(missing))}, which it lacks")
        there.add(name)
    return dict(predictions)


def uses(text: str) -> frozenset[str]:
    """Return the names that an expression uses."""
    return frozenset(_CODE[text].co_names)


def predict(
    predictions: Mapping[str, str],
    columns: Mapping[str, NDArray[Any]],
    constants: Mapping[str, Any],
    starts: NDArray[np.int64],
) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """Yield each predicted column with the bits of its prediction.

    ``columns``: by name. A column that has been yielded must hold its values before the next one is asked for.
    ``starts``: place of the first row of each batch; its predecessor counts as 0, as does the successor of the last.
    """
    scope = {**constants, **columns, "np": np, "before": _before(starts), "after": _after(starts)}
    with np.errstate(all="ignore"):
        for name, text in predictions.items():
            value = eval(_CODE[text], scope)
            if name not in columns:
                scope[name] = value
                continue
            if value.dtype.kind == "f":
                value = np.where(np.isfinite(value), value, 0.0)
            yield name, value.view(np.int64)


def kinds_of_values() -> dict[str, str]:
    """Return the kind of each column of a tick, and of each value in `PREDICTIONS`: ``f`` number, ``i`` integer."""
    numbers = {name: np.float64(value) for name, value in UNKNOWN.items()}
    columns = {name: np.zeros(1, TICK[name]) for name in TICK.names or ()}
    starts = np.zeros(1, np.int64)
    scope: dict[str, Any] = {**numbers, **columns, "np": np, "before": _before(starts), "after": _after(starts)}
    with np.errstate(all="ignore"):
        for name, text in PREDICTIONS.items():
            if name not in columns:
                scope[name] = columns[name] = eval(_CODE[text], scope)
    return {name: column.dtype.kind for name, column in columns.items()}


def _before(starts: NDArray[np.int64]) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """Return the function that gives each row the value of the row before it in its batch."""

    def before(values: NDArray[Any]) -> NDArray[Any]:
        earlier = np.empty_like(values)
        earlier[1:] = values[:-1]
        earlier[starts] = 0
        return earlier

    return before


def _after(starts: NDArray[np.int64]) -> Callable[[NDArray[Any]], NDArray[Any]]:
    """Return the function that gives each row the value of the row after it in its batch."""

    def after(values: NDArray[Any]) -> NDArray[Any]:
        later = np.empty_like(values)
        later[:-1] = values[1:]
        later[starts - 1] = 0  # that of the first batch is the last row of all
        return later

    return after
