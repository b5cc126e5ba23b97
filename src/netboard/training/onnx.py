"""Export of weights as ONNX, for other programs, and its parity with the kernel of netboard.

Nothing of netboard runs the exported file.
"""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from onnx import TensorProto, checker, helper, numpy_helper
from onnxruntime import InferenceSession

from netboard.base.compiled import kernel
from netboard.base.files.new import new_file
from netboard.participants.robots.learned import INPUTS
from netboard.participants.robots.network import TrainedNetwork, pack_network, run, units_of

OPSET, IR_VERSION = 17, 8
"""Versions of operators and file that programs of 2022 and later read [1]."""


def write_onnx(path: Path, network: TrainedNetwork, sha256: str) -> None:
    """Write a network as ONNX: ``inputs`` (n, 15) and ``speed`` (n, 1), both float32 and in the units of the file.

    ``sha256``: of the file of weights; the exported file names it.
    """
    nodes, constants, before = [], [], "inputs"
    for i, (weights, biases) in enumerate(network.layers):
        names = (f"weights_{i}", f"biases_{i}")
        constants += [
            numpy_helper.from_array(array.astype(np.float32), name)
            for array, name in zip((weights, biases), names, strict=True)
        ]
        last = i == len(network.layers) - 1
        nodes.append(helper.make_node("Gemm", [before, *names], ["speed" if last else f"sums_{i}"]))
        if not last:
            nodes.append(helper.make_node("Tanh", [f"sums_{i}"], [f"units_{i}"]))
        before = f"units_{i}"
    given = helper.make_tensor_value_info("inputs", TensorProto.FLOAT, ["n", len(INPUTS)])
    returned = helper.make_tensor_value_info("speed", TensorProto.FLOAT, ["n", 1])
    graph = helper.make_graph(nodes, "netboard_learned_partner", [given], [returned], constants)
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=IR_VERSION)
    helper.set_model_props(
        model, {"weights_sha256": sha256, "inputs": ", ".join(f"{one.name} / {one.scale} {one.unit}" for one in INPUTS)}
    )
    checker.check_model(model)
    with new_file(path) as part:
        part.write_bytes(model.SerializeToString())


@kernel
def _run_all(
    weights: NDArray[np.void], units: NDArray[np.void], inputs: NDArray[np.float64], out: NDArray[np.float64]
) -> None:
    for i in range(len(inputs)):
        for j in range(inputs.shape[1]):
            units[0]["units_0"][j] = inputs[i, j]
        out[i] = run(weights[0], units[0])


def outputs_of(network: TrainedNetwork, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the outputs of netboard's kernel for some inputs, shape (n,) [1]."""
    out = np.zeros(len(inputs))
    _run_all(pack_network(network), np.zeros(1, units_of(network.sizes)), np.ascontiguousarray(inputs), out)
    return out


def largest_difference(path: Path, network: TrainedNetwork, number: int = 10_000, seed: int = 1) -> float:
    """Return the largest difference of outputs between ONNX Runtime and the kernel, for random inputs [1]."""
    inputs = np.random.default_rng(seed).normal(0.0, 2.0, (number, len(INPUTS))).astype(np.float32)
    session = InferenceSession(str(path), providers=["CPUExecutionProvider"])
    (found,) = session.run(["speed"], {"inputs": inputs})
    return float(np.abs(found[:, 0] - outputs_of(network, inputs.astype(np.float64))).max())
