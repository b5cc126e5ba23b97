"""The network of a learned partner: its file, and the kernel that runs it.

A network has two hidden layers of tanh units and one linear output. Its file is JSON: names and scales of the inputs,
the weights, and a card that says how it was trained and how well it does. It holds numbers and texts, never code.

Rule 1: the kernel sums in one fixed order, with a hyperbolic tangent of our own, so that each machine gets the same
bits (decision 0008). Rule 2: what a file must have is checked before its weights are used.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from netboard.base.compiled import inlined
from netboard.base.errors import ConfigError
from netboard.base.settings import parse_json
from netboard.physics.arithmetic.hyperbolic import tanh

FORMAT = "netboard learned partner"
"""First entry of a file of weights."""

VERSION = 1
"""Version of the file: it changes with the inputs, the layers, or what they mean."""

LAYERS = 3
"""Layers of weights: two hidden ones, and the output [1]."""

MOST_UNITS = 128
"""Largest number of units in a layer [1]."""

MOST_WEIGHT = 1e6
"""Largest magnitude of a weight [1]."""


class Input(NamedTuple):
    """A number that the network gets: an input of 1 is ``scale`` in ``unit``."""

    name: str
    scale: float
    unit: str


@dataclass(frozen=True, slots=True, eq=False)
class TrainedNetwork:
    """A network.

    - `layers`: for each layer its weights (shape (inputs, units)) and biases (shape (units,)) [1].
    - `card`: how it was trained, how well it does, and what it must not be used for.
    """

    layers: tuple[tuple[NDArray[np.float64], NDArray[np.float64]], ...]
    card: Mapping[str, Any] = field(default_factory=dict)

    @property
    def sizes(self) -> tuple[int, ...]:
        """Return the number of inputs, and of the units of each layer."""
        return (len(self.layers[0][0]), *(len(biases) for _, biases in self.layers))

    def derivatives(self, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the output by each input, at some inputs (shape (inputs,)) [1]."""
        slopes, units = np.eye(len(inputs)), inputs
        for weights, biases in self.layers[:-1]:
            units = np.tanh(units @ weights + biases)
            slopes = slopes @ weights * (1.0 - units**2)
        return np.asarray((slopes @ self.layers[-1][0])[:, 0])

    def text(self, inputs: Sequence[Input], period: int) -> str:
        """Return the content of its file; ``period``: ticks between two decisions."""
        head = {
            "format": FORMAT,
            "version": VERSION,
            "period_ticks": period,
            "inputs": [one._asdict() for one in inputs],
            "card": self.card,
        }
        start = json.dumps(head, indent=1, ensure_ascii=False).removesuffix("}").rstrip()
        layers = ",\n".join(_layer_text(*layer) for layer in self.layers)
        return f'{start},\n "layers": [\n{layers}\n ]\n}}\n'


def _layer_text(weights: NDArray[np.float64], biases: NDArray[np.float64]) -> str:
    """Return a layer as JSON: the weights of an input on each line."""
    rows = ",\n".join(f"   {json.dumps(row)}" for row in weights.tolist())
    return f'  {{"weights": [\n{rows}],\n   "biases": {json.dumps(biases.tolist())}}}'


def sha256_of(text: str) -> str:
    """Return the SHA-256 of a file with this content, in hexadecimal."""
    return hashlib.sha256(text.encode()).hexdigest()


def parse_network(text: str, source: str, inputs: Sequence[Input], period: int) -> TrainedNetwork:
    """Read the content of a file of weights for the inputs, and the ticks between decisions, of this version.

    Raises
    ------
    ConfigError
        If it is no such file, of another version, or its weights have other shapes or are not finite.
    """
    found = _object_of(text, source)
    if found.get("version") != VERSION:
        raise ConfigError(f"{source}: version: found {found.get('version')!r}, expected {VERSION}")
    if found.get("period_ticks") != period:
        raise ConfigError(f"{source}: period_ticks: found {found.get('period_ticks')!r}, expected {period}")
    if found.get("inputs") != [one._asdict() for one in inputs]:
        names = ", ".join(f"{one.name} over {one.scale:g} {one.unit}" for one in inputs)
        raise ConfigError(f"{source}: inputs: found others than expected: {names}")
    card, layers = found.get("card"), found.get("layers")
    if not isinstance(card, dict):
        raise ConfigError(f"{source}: card: found {_shown(card)}, expected an object")
    if not isinstance(layers, list) or len(layers) != LAYERS:
        raise ConfigError(f"{source}: layers: found {_shown(layers)}, expected {LAYERS}")
    network = TrainedNetwork(tuple(_layer_of(one, f"{source}: layer {i + 1}") for i, one in enumerate(layers)), card)
    _require_shapes(network, source, len(inputs))
    return network


def _object_of(text: str, source: str) -> dict[str, Any]:
    """Return the object in a file of weights."""
    wanted = "expected the weights.json that netboard train writes"
    try:
        found = parse_json(text)
    except ValueError as error:
        raise ConfigError(f"{source}: {wanted}; it is not JSON, or was cut off ({error})") from error
    if not isinstance(found, dict) or found.get("format") != FORMAT:
        raise ConfigError(f'{source}: {wanted}, which begins with "format": "{FORMAT}"')
    return found


def _layer_of(found: object, where: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the weights and biases of a layer."""
    if not isinstance(found, dict):
        raise ConfigError(f"{where}: found {_shown(found)}, expected an object of weights and biases")
    return _numbers_of(found.get("weights"), 2, f"{where}: weights"), _numbers_of(
        found.get("biases"), 1, f"{where}: biases"
    )


def _numbers_of(found: object, axes: int, where: str) -> NDArray[np.float64]:
    """Return an array of finite numbers."""
    try:
        array = np.array(found)
    except ValueError:
        raise ConfigError(f"{where}: found lists of different lengths, expected equal ones") from None
    if array.dtype.kind not in "if" or array.ndim != axes or array.size == 0:
        raise ConfigError(f"{where}: found {_shown(found)}, expected numbers in {axes} dimension{'s' * (axes > 1)}")
    wrong = ~(np.abs(array) <= MOST_WEIGHT)
    if wrong.any():
        raise ConfigError(f"{where}: found {array[wrong][0]}, expected numbers up to {MOST_WEIGHT:g}")
    return array.astype(np.float64)


def _require_shapes(network: TrainedNetwork, source: str, inputs: int) -> None:
    """Refuse layers that do not fit each other, the inputs or the output."""
    shapes = [weights.shape for weights, _ in network.layers]
    ends = [inputs, *(len(biases) for _, biases in network.layers)]
    if shapes != list(pairwise(ends)) or ends[-1] != 1 or max(ends) > MOST_UNITS:
        found = ", ".join(f"{rows} x {units} with {end}" for (rows, units), end in zip(shapes, ends[1:], strict=True))
        raise ConfigError(
            f"{source}: layers: found weights of {found} biases, expected {inputs} x m with m, m x n with n, n x 1 "
            f"with 1, of at most {MOST_UNITS} units"
        )


def _shown(found: object) -> str:
    """Return what was found, for a message."""
    return f"{len(found)} entries" if isinstance(found, list | dict) else repr(found)


def packed_as(sizes: Sequence[int]) -> "np.dtype[Any]":
    """Return the record of the weights of a network of these sizes."""
    fields: list[tuple[str, str, tuple[int, ...]]] = []
    for i, (rows, units) in enumerate(pairwise(sizes)):
        fields += [(f"weights_{i}", "<f8", (rows, units)), (f"biases_{i}", "<f8", (units,))]
    return np.dtype(fields)


def units_of(sizes: Sequence[int]) -> "np.dtype[Any]":
    """Return the record of the inputs and the units of a network of these sizes."""
    return np.dtype([(f"units_{i}", "<f8", (size,)) for i, size in enumerate(sizes)])


def pack_network(network: TrainedNetwork) -> NDArray[Any]:
    """Return the weights for the kernel: ndarray, shape (1,)."""
    packed = np.zeros(1, packed_as(network.sizes))
    for i, (weights, biases) in enumerate(network.layers):
        packed[f"weights_{i}"], packed[f"biases_{i}"] = weights, biases
    return packed


@inlined
def _summed(
    weights: NDArray[np.float64], biases: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]
) -> None:
    """Sum the weighted inputs of a layer: input by input, so that the units are lanes, each with its own order."""
    for j in range(len(y)):
        y[j] = biases[j]
    for i in range(len(x)):
        for j in range(len(y)):
            y[j] += weights[i, j] * x[i]


@inlined
def _squashed(y: NDArray[np.float64]) -> None:
    """Apply the hyperbolic tangent to each unit."""
    for j in range(len(y)):
        y[j] = tanh(y[j])


@inlined
def run(weights: np.void, units: np.void) -> float:
    """Return the output of a network for the inputs in ``units_0`` [1]."""
    _summed(weights["weights_0"], weights["biases_0"], units["units_0"], units["units_1"])
    _squashed(units["units_1"])
    _summed(weights["weights_1"], weights["biases_1"], units["units_1"], units["units_2"])
    _squashed(units["units_2"])
    _summed(weights["weights_2"], weights["biases_2"], units["units_2"], units["units_3"])
    return float(units["units_3"][0])
