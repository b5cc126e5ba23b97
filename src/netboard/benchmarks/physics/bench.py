"""``netboard bench physics``: the cost of a live tick on this machine, compared with its lower bound."""

from collections.abc import Iterator, Sequence
from functools import partial

from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.physics.problem import MODELS, Model, Problem
from netboard.benchmarks.physics.tick_cost import tick_part

REPEATS, QUICK_REPEATS = 15, 5


def main(model: Model | None, repeats: int | None, options: Options) -> None:
    """Run the study of one model, or of all."""
    problems = [Problem(one, "settled") for one in MODELS if model in (None, one)]
    count = repeats or (QUICK_REPEATS if options.quick else REPEATS)
    run("physics", partial(study, problems, count), options, {"repeats": count}, bar=False)


def study(
    problems: Sequence[Problem], repeats: int, folder: Folder, tell: Tell, *, quick: bool
) -> Iterator[ResultPart]:
    """Measure a tick of each problem."""
    tell("the live tick", 0.0)
    yield tick_part(problems, repeats)
