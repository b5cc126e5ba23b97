"""Files of weights: what is written is read, what is no such file is refused in words; the kernel against NumPy."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from made_network import made_network, made_text
from netboard.base.compiled import kernel
from netboard.base.errors import ConfigError
from netboard.participants.robots.learned import INPUTS, PERIOD, read_weights
from netboard.participants.robots.network import TrainedNetwork, pack_network, parse_network, run, sha256_of, units_of
from netboard.participants.robots.network_stability import (
    NetworkGains,
    RestingBoard,
    decision_matrix,
    largest_view_latency,
    resting_boards,
)

SIZES = (len(INPUTS), 5, 4, 1)


def parsed(text: str) -> TrainedNetwork:
    return parse_network(text, "weights.json", INPUTS, PERIOD)


def changed(change: Callable[[dict[str, Any]], Any]) -> str:
    found = json.loads(made_text())
    change(found)
    return json.dumps(found)


def expected_outputs(network: TrainedNetwork, inputs: NDArray[np.float64]) -> NDArray[np.float64]:
    (w0, b0), (w1, b1), (w2, b2) = network.layers
    return np.asarray((np.tanh(np.tanh(inputs @ w0 + b0) @ w1 + b1) @ w2 + b2)[:, 0])


@kernel
def _run_all(weights: Any, units: Any, inputs: Any, out: Any) -> None:
    for i in range(len(inputs)):
        for j in range(inputs.shape[1]):
            units[0]["units_0"][j] = inputs[i, j]
        out[i] = run(weights[0], units[0])


def test_file_is_read_as_it_was_written() -> None:
    network = made_network()
    found = parsed(network.text(INPUTS, PERIOD))
    for (weights, biases), (read, read_biases) in zip(network.layers, found.layers, strict=True):
        assert (weights.tobytes(), biases.tobytes()) == (read.tobytes(), read_biases.tobytes())
    assert found.card == network.card
    assert found.sizes == SIZES


def test_kernel_agrees_with_numpy() -> None:
    network, inputs = made_network(), np.random.default_rng(2).normal(size=(200, len(INPUTS)))
    out = np.zeros(len(inputs))
    _run_all(pack_network(network), np.zeros(1, units_of(network.sizes)), inputs, out)
    assert out == pytest.approx(expected_outputs(network, inputs), abs=1e-13)


def test_derivatives_agree_with_differences() -> None:
    network, x, step = made_network(), np.linspace(-1.0, 1.0, len(INPUTS)), 1e-5
    steps = step * np.eye(len(INPUTS))
    slopes = (expected_outputs(network, x + steps) - expected_outputs(network, x - steps)) / (2.0 * step)
    assert network.derivatives(x) == pytest.approx(slopes, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"weights.json: expected the weights.json that netboard train writes; it is not JSON"),
        (made_text()[:-30], r"is not JSON, or was cut off"),
        ("[1, 2]", r"which begins with \"format\""),
        ('{"format": "another"}', r"which begins with \"format\""),
        (changed(lambda f: f.update(version=2)), r"version: found 2, expected 1"),
        (changed(lambda f: f.update(period_ticks=10)), r"period_ticks: found 10, expected 20"),
        (changed(lambda f: f["inputs"].pop()), r"inputs: found others than expected: active over 1 1"),
        (changed(lambda f: f.pop("card")), r"card: found None, expected an object"),
        (changed(lambda f: f["layers"].pop()), r"layers: found 2 entries, expected 3"),
        (changed(lambda f: f["layers"].__setitem__(0, 7)), r"layer 1: found 7, expected an object"),
        (changed(lambda f: f["layers"][0].pop("biases")), r"layer 1: biases: found None, expected numbers in 1 dim"),
        (changed(lambda f: f["layers"][1]["biases"].append(0.0)), r"found weights of 15 x 5 with 5, 5 x 4 with 5"),
        (changed(lambda f: f["layers"][1]["weights"][0].pop()), r"layer 2: weights: found lists of different lengths"),
        (changed(lambda f: f["layers"][2]["weights"].pop()), r"expected 15 x m with m, m x n with n, n x 1 with 1"),
        (changed(lambda f: f["layers"][0]["biases"].__setitem__(0, float("nan"))), r"layer 1: biases: found nan"),
        (changed(lambda f: f["layers"][0]["biases"].__setitem__(0, 1e7)), r"found 10000000.0, expected numbers up to"),
        (changed(lambda f: f["layers"][0]["biases"].__setitem__(0, "1")), r"biases: found 5 entries, expected numbers"),
        (made_text(units=(129, 4)), r"of at most 128 units"),
    ],
)
def test_file_that_is_not_one_is_refused_in_words(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parsed(text)


def test_file_that_cannot_be_read_is_refused_in_words(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no such file; expected the weights.json that netboard train writes, or l"):
        read_weights(str(tmp_path / "none.json"))
    binary = tmp_path / "pickle.json"
    binary.write_bytes(b"\x80\x04\x95\x00")
    with pytest.raises(ConfigError, match=r"is not UTF-8; expected the weights.json that netboard train writes, or l"):
        read_weights(str(binary))


def test_sha256_is_that_of_the_file(tmp_path: Path) -> None:
    text = made_text()
    (tmp_path / "weights.json").write_text(text)
    assert read_weights(str(tmp_path / "weights.json"))[1] == sha256_of(text)


def test_file_that_has_changed_is_read_again(tmp_path: Path) -> None:
    """An agent lives longer than a session, before which its partner may be trained again."""
    path = tmp_path / "weights.json"
    for seed in (1, 2):
        path.write_text(made_text(seed))
        network, sha256 = read_weights(str(path))
        assert sha256 == sha256_of(made_text(seed))
        assert network.layers[0][0].tolist() == made_network(seed).layers[0][0].tolist()


STILL, SAME = resting_boards(0.25, 200.0, 200.0, 9.81)
GAINS = NetworkGains(0.0, 0.0, -20.0 * 0.25, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Of a hand that only levels the board, at 20/s: the tilt decays as exp(-20 c t)."""


def test_levelling_is_a_sampled_first_order_loop() -> None:
    # The sampled gain is 20/s x 0.02 s beside one that does the same, half of it beside one that is still.
    for board, gain in ((STILL, 0.2), (SAME, 0.4)):
        levels = decision_matrix(GAINS, board._replace(slope=0.0), PERIOD, 0)
        found = np.abs(np.linalg.eigvals(levels))
        assert np.isclose(found, 1.0 - gain).any()


def test_stable_latency_of_levelling_is_that_of_the_sampled_loop() -> None:
    # z^2 - z + k = 0 for a latency of one period: stable up to k = 1, so 50/s at 20 ms beside one that does the same.
    def radius(rate: float) -> float:
        gains = GAINS._replace(tilt=-rate * 0.25)
        return float(np.abs(np.linalg.eigvals(decision_matrix(gains, SAME._replace(slope=0.0), PERIOD, PERIOD))).max())

    assert radius(49.0) <= 1.0 + 1e-6
    assert radius(51.0) > 1.0 + 1e-6


def test_steering_with_too_much_gain_is_unstable_and_a_pd_law_is_stable_to_some_latency() -> None:
    kp, kd, lead = 4.0, 4.0, 20.0
    board: RestingBoard = SAME
    gains = GAINS._replace(ball=lead * 0.25 * kp / 9.81, ball_rate=lead * 0.25 * kd / 9.81)
    assert 20 <= largest_view_latency(gains, (board,), PERIOD) < 120
    assert largest_view_latency(gains._replace(ball=50.0), (board,), PERIOD) == -1
