"""``netboard bench physics``: what the physics costs, how good it is, and beside whom; all in one run on one machine.

Its parts: runs of all methods and peers on the test problems, the frontier, ratios at equal error; what sampling costs;
what a live tick costs beside the least it could; what is saved where a scene needs less.
"""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from netboard.base.errors import ConfigError
from netboard.benchmarks.harness.machine import describe
from netboard.benchmarks.harness.results import Folder, Part, new_folder, show
from netboard.benchmarks.physics import figures, peer_drake, peer_heyoka, peer_mujoco, peer_solvers
from netboard.benchmarks.physics import parts as physics_parts
from netboard.benchmarks.physics.holds import hold_rows
from netboard.benchmarks.physics.horizons import expect_parts
from netboard.benchmarks.physics.own_methods import (
    collocation_contenders,
    multistep_contenders,
    one_step_contenders,
    own_solution,
)
from netboard.benchmarks.physics.parts import Checked
from netboard.benchmarks.physics.problem import MODELS, STARTS, Model, Problem, errors_of, make_reference, tight
from netboard.benchmarks.physics.skips import skip_rows
from netboard.benchmarks.physics.solver import Contender, installed
from netboard.benchmarks.physics.tick_cost import measure_tick
from netboard.benchmarks.physics.work_precision import Row, compare, measure


@dataclass(frozen=True)
class Peer:
    """A library that takes part if it is installed.

    Attributes
    ----------
    contenders : callable
        Makes its contenders, of a problem and of whether a few are enough.
    """

    package: str
    available: Callable[[], bool]
    contenders: Callable[[Problem, bool], list[Contender]]
    quick: bool = False


PEERS = {
    "heyoka": Peer("heyoka", peer_heyoka.available, peer_heyoka.contenders, quick=True),
    "mujoco": Peer("mujoco", peer_mujoco.available, peer_mujoco.contenders, quick=True),
    "scipy": Peer("scipy", lambda: True, peer_solvers.scipy_contenders, quick=True),
    "cvode": Peer("scikit-sundae", peer_solvers.cvode_available, peer_solvers.cvode_contenders),
    "diffrax": Peer("diffrax", peer_solvers.diffrax_available, peer_solvers.diffrax_contenders),
    "drake": Peer("drake", peer_drake.available, peer_drake.contenders),
}
"""By the name that the command knows them by."""

REPEATS, QUICK_REPEATS = 15, 5
QUICK_PROBLEMS = 3
"""A quick run leaves the last one out [1]."""

BUDGET, QUICK_BUDGET = 1.0, 0.1
"""Time after which a solver gets no further repetition [s]."""

WIDTH = 132
"""Minimum width of tables [characters]."""

Say = Callable[[str], object]


@dataclass(frozen=True)
class Wanted:
    """What is asked for.

    Attributes
    ----------
    peers : tuple of str
        Names of the peers that take part, all of them installed.
    budget : float
        Who has taken this long has no further turn [s].
    """

    problems: tuple[Problem, ...]
    peers: tuple[str, ...]
    quick: bool
    repeats: int
    budget: float


def main(
    output: Path | None,
    *,
    quick: bool = False,
    force: bool = False,
    peers: Sequence[str] | None = None,
    model: Model | None = None,
    repeats: int | None = None,
) -> int:
    """Run the study, print it and write it into a folder.

    Parameters
    ----------
    peers : sequence of str or None
        Who else takes part; None for all that are installed and quick enough.

    Raises
    ------
    ConfigError
        If there is no such peer, one asked for is not installed, or the folder is there already.
    """
    problems = [Problem(one, start) for one in MODELS if model in (None, one) for start in STARTS]
    wanted = Wanted(
        tuple(problems[:QUICK_PROBLEMS] if quick else problems),
        choose_peers(peers, quick),
        quick,
        repeats or (QUICK_REPEATS if quick else REPEATS),
        QUICK_BUDGET if quick else BUDGET,
    )
    folder = Folder(output or new_folder("bench-physics"), force=force)
    console = Console(highlight=False, markup=False)
    console.width = max(console.width, WIDTH)
    for line in (*describe().lines(), *_who(wanted)):
        console.print(line)
    bar = Progress(TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), console=Console(stderr=True))
    with bar:
        task = bar.add_task("starting", total=None)
        rows, parts = study(wanted, lambda stage: bar.update(task, description=stage))
        bar.update(task, description="done", total=1, completed=1)
    for part in parts:
        if part.name != "runs":
            show(console, part)
    folder.write(parts, about(wanted))
    if installed("matplotlib"):
        figures.draw(rows, folder, signals=not quick)
    else:
        console.print("no figures: matplotlib is not installed")
    console.print(f"written to {folder.path}")
    return 0


def choose_peers(asked: Sequence[str] | None, quick: bool) -> tuple[str, ...]:
    """Choose the solvers under comparison."""
    for name in asked or ():
        if name not in PEERS:
            raise ConfigError(f'--peers: found "{name}", expected some of {", ".join(PEERS)}')
        if not PEERS[name].available():
            raise ConfigError(f"--peers: {PEERS[name].package} is not installed; pip install 'netboard[bench]' has all")
    if asked is not None:
        return tuple(asked)
    return tuple(name for name, peer in PEERS.items() if peer.available() and (peer.quick or not quick))


def study(wanted: Wanted, say: Say = lambda stage: None) -> tuple[list[Row], list[Part]]:
    """Run all parts of the study."""
    references, rows = {}, []
    for problem in wanted.problems:
        say(f"{problem.name}: reference")
        references[problem] = find_reference(problem)
        contenders = _contenders(problem, wanted)
        rows += measure(problem, references[problem].reference, contenders, wanted.repeats, wanted.budget, say)
    comparisons = compare(rows)
    parts = [
        physics_parts.reference_part(list(references.values())),
        physics_parts.runs_part(rows),
        physics_parts.steps_part(rows),
        *physics_parts.costs_parts(rows),
        physics_parts.frontier_part(rows),
        *physics_parts.ratios_parts(comparisons),
    ]
    if any(row.family == peer_mujoco.FAMILY for row in rows):
        parts.append(physics_parts.mujoco_part(rows, comparisons))
    chosen = [problem for problem in wanted.problems if problem.start == "settled"][: 1 if wanted.quick else None]
    say("from samples")
    holds = [row for problem in chosen for row in hold_rows(problem, references[problem].reference)]
    expected = [part for problem in chosen[:1] for part in expect_parts(problem, references[problem].reference)]
    say("the live tick")
    ticks = [measure_tick(problem, wanted.repeats) for problem in chosen]
    say("lesser scenes")
    skips = [row for problem in chosen for row in skip_rows(problem.model, wanted.repeats)]
    parts += [
        physics_parts.holds_part(holds),
        *expected,
        physics_parts.tick_part(ticks),
        physics_parts.skips_part(skips),
    ]
    return rows, parts


def find_reference(problem: Problem) -> Checked:
    """Solve a problem as accurately as possible, and once more as a check."""
    states = tight(problem)
    if peer_heyoka.available():
        reference, check = make_reference(problem, "heyoka, 80 bits", peer_heyoka.precise(problem)), "scipy DOP853"
    else:
        reference, check = make_reference(problem, "scipy DOP853", states), "our dop853, 0.25 ms"
        states = own_solution(problem, "dop853", 0.00025)
    apart = errors_of(problem, reference, states, 1) / reference.scales
    return Checked(problem, reference, check, float(apart.max()))


def _contenders(problem: Problem, wanted: Wanted) -> list[Contender]:
    """Return all solvers compared on a problem."""
    found = one_step_contenders(problem, wanted.quick) + collocation_contenders(problem, wanted.quick)
    found += multistep_contenders(problem, wanted.quick)
    for name in wanted.peers:
        found += PEERS[name].contenders(problem, wanted.quick)
    return found


def _version(package: str) -> str:
    """Return the version of a package."""
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _who(wanted: Wanted) -> list[str]:
    """List the solvers that take part, and those that cannot."""
    here = ", ".join(f"{PEERS[name].package} {_version(PEERS[name].package)}" for name in wanted.peers)
    missing = ", ".join(peer.package for peer in PEERS.values() if not peer.available())
    lines = [f"peers: {here or 'none'}"]
    if missing:
        lines.append(f"not installed: {missing} (pip install 'netboard[bench]')")
    return lines


def about(wanted: Wanted) -> dict[str, object]:
    """Return the settings of the run, for the head of the results."""
    return {
        "study": "physics",
        "quick": wanted.quick,
        "repeats": wanted.repeats,
        "budget_s": wanted.budget,
        "peers": {peer.package: _version(peer.package) for peer in PEERS.values()},
        "problems": [
            {"name": problem.name, "duration_s": problem.duration, "first": problem.first, **asdict(problem.physics)}
            for problem in wanted.problems
        ],
    }
