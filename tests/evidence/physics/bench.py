"""``make evidence ARGS=physics``: cost and accuracy of the physics, compared with other libraries in one run.

Its parts: runs of all methods and libraries on the test problems, their Pareto frontier, cost ratios at equal error,
the error of sampling, the cost of a live tick and its lower bound, and the cost of simpler scenes.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib.util import find_spec

from evidence.physics import figures, peer_drake, peer_heyoka, peer_mujoco, peer_solvers
from evidence.physics import parts as physics_parts
from evidence.physics.horizons import expect_parts, holds_part
from evidence.physics.netboard_methods import collocation_solvers, one_step_solution, one_step_solvers
from evidence.physics.netboard_taylor import taylor_solvers
from evidence.physics.reference import errors_of, make_reference, tight
from evidence.physics.work_precision import Row, Solver, compare, measure
from netboard.base.errors import ConfigError
from netboard.benchmarks.harness.machine import version_of
from netboard.benchmarks.harness.results import Folder, ResultPart
from netboard.benchmarks.harness.running import Options, Tell, run
from netboard.benchmarks.physics.problem import MODELS, STARTS, Model, Problem
from netboard.benchmarks.physics.tick_cost import tick_part


@dataclass(frozen=True)
class Peer:
    """A library that is compared if it is installed.

    - `package`, `module`: its names for pip and for Python.
    - `solvers`: returns its solvers for a problem; all, or a few.
    """

    package: str
    module: str
    solvers: Callable[[Problem, bool], list[Solver]]
    quick: bool = False

    @property
    def available(self) -> bool:
        """Whether the library is installed."""
        return find_spec(self.module) is not None


PEERS = {
    "heyoka": Peer("heyoka", "heyoka", peer_heyoka.solvers, quick=True),
    "mujoco": Peer("mujoco", "mujoco", peer_mujoco.solvers, quick=True),
    "scipy": Peer("scipy", "scipy", peer_solvers.scipy_solvers, quick=True),
    "cvode": Peer("scikit-sundae", "sksundae", peer_solvers.cvode_solvers),
    "diffrax": Peer("diffrax", "diffrax", peer_solvers.diffrax_solvers),
    "drake": Peer("drake", "pydrake", peer_drake.solvers),
}
"""Libraries under comparison, by the name on the command line."""

REPEATS, QUICK_REPEATS = 15, 5
QUICK_PROBLEMS = 3
"""Number of problems of a quick run, which leaves the last one out [1]."""

BUDGET, QUICK_BUDGET = 1.0, 0.1
"""Time after which a solver is not repeated again [s]."""


@dataclass(frozen=True)
class Selection:
    """The problems and the peers of a run, and how often each solver is timed.

    - `peers`: names of the libraries under comparison, all of them installed.
    - `budget`: time after which a solver is not repeated again [s].
    """

    problems: tuple[Problem, ...]
    peers: tuple[str, ...]
    repeats: int
    budget: float


def main(options: Options, *, peers: Sequence[str] | None, model: Model | None, repeats: int | None) -> None:
    """Run the study.

    - `peers`: libraries under comparison; None for all that are installed and fast enough.
    """
    quick = options.quick
    problems = [Problem(one, start) for one in MODELS if model in (None, one) for start in STARTS]
    selection = Selection(
        tuple(problems[:QUICK_PROBLEMS] if quick else problems),
        choose_peers(peers, quick),
        repeats or (QUICK_REPEATS if quick else REPEATS),
        QUICK_BUDGET if quick else BUDGET,
    )
    lines = _libraries(selection)
    if find_spec("matplotlib") is None:
        lines.append("no figures: matplotlib is not installed")
    run("physics", partial(study, selection), options, about(selection), lines=lines)


def choose_peers(asked: Sequence[str] | None, quick: bool) -> tuple[str, ...]:
    """Choose the solvers under comparison."""
    for name in asked or ():
        if name not in PEERS:
            raise ConfigError(f'--peers: found "{name}", expected some of {", ".join(PEERS)}')
        if not PEERS[name].available:
            raise ConfigError(f"--peers: {PEERS[name].package} is not installed: pip install '.[evidence]'")
    if asked is not None:
        return tuple(asked)
    return tuple(name for name, peer in PEERS.items() if peer.available and (peer.quick or not quick))


def study(selection: Selection, folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
    """Run all parts of the study, and draw the runs."""
    references: dict[Problem, physics_parts.Checked] = {}
    rows: list[Row] = []
    for problem in selection.problems:
        share = 0.8 * len(references) / len(selection.problems)
        tell(f"{problem.name}: reference", share)
        references[problem] = find_reference(problem)
        solvers = _solvers(problem, selection, quick)
        rows += measure(
            problem, references[problem].reference, solvers, selection.repeats, selection.budget, tell, share
        )
    comparisons = compare(rows)
    yield physics_parts.reference_part(list(references.values()))
    yield physics_parts.runs_part(rows)
    yield physics_parts.steps_part(rows)
    yield from physics_parts.costs_parts(rows)
    yield physics_parts.frontier_part(rows)
    yield from physics_parts.ratios_parts(comparisons)
    if any(row.library == peer_mujoco.LIBRARY for row in rows):
        lagrangian = [problem for problem in selection.problems if problem.model == "lagrangian"]
        many = {problem.name: peer_mujoco.many_at_once(problem, selection.repeats) for problem in lagrangian}
        yield physics_parts.mujoco_part(rows, comparisons, many)
    chosen = [problem for problem in selection.problems if problem.start == "settled"][: 1 if quick else None]
    tell("from samples", 0.8)
    yield holds_part((problem, references[problem].reference) for problem in chosen)
    for problem in chosen[:1]:
        yield from expect_parts(problem, references[problem].reference)
    tell("the live tick", 0.9)
    yield tick_part(chosen, selection.repeats)
    figures.draw(rows, folder, signals=not quick)


def find_reference(problem: Problem) -> physics_parts.Checked:
    """Solve a problem as accurately as possible, and a second time by another solver as a check."""
    states = tight(problem)
    if PEERS["heyoka"].available:
        reference, check = make_reference(problem, "heyoka, 80 bits", peer_heyoka.precise(problem)), "scipy DOP853"
    else:
        reference, check = make_reference(problem, "scipy DOP853", states), "our dop853, 0.25 ms"
        states = one_step_solution(problem, "dop853", 0.00025)
    apart = errors_of(problem, reference, states, 1) / reference.scales
    return physics_parts.Checked(problem, reference, check, float(apart.max()))


def _solvers(problem: Problem, selection: Selection, quick: bool) -> list[Solver]:
    found = one_step_solvers(problem, quick) + collocation_solvers(problem, quick) + taylor_solvers(problem, quick)
    for name in selection.peers:
        found += PEERS[name].solvers(problem, quick)
    return found


def _libraries(selection: Selection) -> list[str]:
    """List the libraries under comparison, and those that are not installed."""
    here = ", ".join(f"{PEERS[name].package} {version_of(PEERS[name].package)}" for name in selection.peers)
    missing = ", ".join(peer.package for peer in PEERS.values() if not peer.available)
    lines = [f"peers: {here or 'none'}"]
    if missing:
        lines.append(f"not installed: {missing} (pip install '.[evidence]')")
    return lines


def about(selection: Selection) -> dict[str, object]:
    """Return the settings of the run, for the head of the results."""
    return {
        "repeats": selection.repeats,
        "budget_s": selection.budget,
        "peers": {peer.package: version_of(peer.package) for peer in PEERS.values()},
        "problems": [
            {"name": problem.name, "duration_s": problem.duration, "first": problem.first, **asdict(problem.physics)}
            for problem in selection.problems
        ],
    }
