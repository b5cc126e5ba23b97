"""Many dyads at one server: how many one core holds, and what they cost on all cores and when idle."""

from collections.abc import Iterator
from functools import partial

from evidence.loop.scale import (
    LightPeers,
    idle_part,
    measure_idle,
    measure_scale,
    measure_shared,
    scale_part,
    shared_part,
)
from netboard.base.config import Config
from netboard.base.errors import ConfigError
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.loop.bench import scratch_folder

MAX_DYADS = 256

SECONDS, QUICK_SECONDS = 6.0, 2.0
"""Duration of each measurement [s]."""

DYADS, QUICK_DYADS = (1, 2, 4, 6, 8), (1, 2)
"""Numbers of dyads [1]."""


def main(text: str | None, options: Options) -> None:
    """Measure a server with numbers of dyads, as in ``1,2,4``; None for the default."""
    dyads = read_dyads(text) if text else QUICK_DYADS if options.quick else DYADS
    run("dyads", partial(study, dyads), options, {"dyads": list(dyads)})


def read_dyads(text: str) -> tuple[int, ...]:
    """Parse the numbers of dyads, as in ``1,2,4``."""
    try:
        numbers = tuple(int(number) for number in text.split(","))
    except ValueError:
        numbers = (0,)
    if not all(0 < number <= MAX_DYADS for number in numbers):
        raise ConfigError(f"--dyads: found {text}, expected numbers from 1 to {MAX_DYADS} with commas between")
    return numbers


def study(dyads: tuple[int, ...], folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Measure a server with lightweight peers."""
    config, seconds, most = Config(), QUICK_SECONDS if quick else SECONDS, max(dyads)
    with scratch_folder(config, folder, tell) as scratch, LightPeers(scratch) as peers:
        found = measure_scale(config, peers, dyads, seconds, tell)
        yield scale_part(found)
        yield shared_part(most, measure_shared(config, scratch, most, seconds, tell))
        yield idle_part(max(found), measure_idle(config, peers, max(found), seconds, tell))
