"""``make evidence ARGS=robots``: completion times and failures of robot partners, and their largest stable latencies.

Each robot plays with haptic feedback beside a simulated participant (at both sides, half of the blocks each), beside a
hand that is held still, and beside itself. The first row is a simulated participant in place of the robot.
"""

from collections.abc import Iterator
from statistics import fmean, stdev

from netboard.base.config import Config, parse
from netboard.base.tables.simulated import Participant
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Tell
from netboard.participants.robots.robot import RobotPolicy, loops_of, stable_latency_ms
from netboard.participants.seat.block import BlockSummary, Rehearsal
from netboard.participants.seat.partners import POLICIES, make_partner

TRIALS, QUICK_TRIALS = 30, 3
"""Successful trials in each block [1]."""

SEEDS, QUICK_SEEDS = 4, 1
"""Blocks of each robot beside a simulated participant, at each side [1]."""

PEOPLE = {"A": Participant(), "B": Participant()}


def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run all robots beside all partners."""
    trials, seeds = (QUICK_TRIALS, QUICK_SEEDS) if quick else (TRIALS, SEEDS)
    names = [name for name, target in POLICIES.items() if ".robots." in target]  # not what has to be given a recording
    robots = {name: made for name in names if isinstance(made := make_partner(name, Config(), "right"), RobotPolicy)}
    part = ResultPart(
        "completion",
        "Completion times of a target, from the release",
        (
            "partner",
            "trials [1]",
            "mean [s]",
            "SD [s]",
            "longest [s]",
            "failed [1]",
            "beside still [s]",
            "beside itself [s]",
        ),
    )
    for step, name in enumerate(("person", *robots)):
        tell(f"blocks of {name}", step / (len(robots) + 1))
        part.add(*_row(name, trials, seeds))
    done = [row for row in part.rows if row[1] == 2 * seeds * trials]
    part.claim("every block is completed", len(done) == len(part.rows), f"{len(done)} of {len(part.rows)} partners")
    yield part
    yield stability_part(robots)


def _row(name: str, trials: int, seeds: int) -> tuple[str | float | int, ...]:
    """Return the results of a partner."""
    blocks = [
        played(left, right, trials, seed)
        for seed in range(1, seeds + 1)
        for left, right in (("person", name), (name, "person"))
    ]
    times = [time for block in blocks for time in block.completions]
    alone, twins = played(name, "still", trials, 1), played(name, name, trials, 1)
    failures = sum(block.failures for block in blocks)
    spread = stdev(times) if len(times) > 1 else 0.0
    shown = "simulated participant" if name == "person" else name
    return (
        shown,
        len(times),
        fmean(times),
        spread,
        max(times),
        failures,
        fmean(alone.completions),
        fmean(twins.completions),
    )


def played(left: str, right: str, trials: int, seed: int) -> BlockSummary:
    """Run a block and return its results."""
    keys = {"left": left, "right": right, "trials": trials, "seed": seed}
    rehearsal = Rehearsal(parse("", overrides=[f"block.{key}={value}" for key, value in keys.items()]), PEOPLE)
    for _ in rehearsal.pieces():
        pass
    return rehearsal.summary()


def stability_part(robots: dict[str, RobotPolicy]) -> ResultPart:
    """Return the largest stable latencies of each robot."""
    config = Config()
    part = ResultPart(
        "stability", "Largest stable latency, up to the longest examined", "partner | hand [ms] | sight [ms]"
    )
    for name, robot in robots.items():
        hand = min(stable_latency_ms(loop) for loop in loops_of(config, robot.parameters))
        part.add(name, hand, robot.stable_view_latency_ms(config))
    return part
