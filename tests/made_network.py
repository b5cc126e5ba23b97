"""A small network of random weights, for tests, and its file."""

from itertools import pairwise

import numpy as np

from netboard.participants.robots.learned import INPUTS, PACKAGED, PERIOD, read_weights
from netboard.participants.robots.network import TrainedNetwork


def made_network(seed: int = 1, units: tuple[int, int] = (5, 4)) -> TrainedNetwork:
    """Return a network with some units in its hidden layers."""
    rng, sizes = np.random.default_rng(seed), (len(INPUTS), *units, 1)
    layers = [(rng.normal(size=(a, b)), rng.normal(size=b)) for a, b in pairwise(sizes)]
    return TrainedNetwork(tuple(layers), {"trained on": "nothing"})


def made_text(seed: int = 1, units: tuple[int, int] = (5, 4)) -> str:
    """Return the content of its file."""
    return made_network(seed, units).text(INPUTS, PERIOD)


def noted_text(note: str) -> str:
    """Return the file of the network that comes with netboard, with a note in its card: another file, which steers."""
    network = read_weights(PACKAGED)[0]
    return TrainedNetwork(network.layers, {**network.card, "note": note}).text(INPUTS, PERIOD)
