"""Stability of the integration methods: the parts of ``netboard bench stability``, corrupted samples, and long runs."""

from collections.abc import Iterator

from evidence.stability.corrupted_samples import corrupted_samples
from evidence.stability.soak import soak
from netboard.base.config import Config
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.benchmarks.stability import bench

SOAK_STEPS = 1_000_000_000
QUICK_SOAK_STEPS = 10_000_000


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run the parts of the study, one after the other."""
    yield from bench.study(folder, tell, quick=quick)
    tell("corrupted samples", 0.0)
    yield corrupted_samples(Config())
    yield soak(QUICK_SOAK_STEPS if quick else SOAK_STEPS, tell=tell)
