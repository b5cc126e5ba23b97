"""``make evidence ARGS=faults``: injects every fault of the table into real processes, and checks the reaction.

Faults that need the same site are injected into it one after the other; if the site does not recover from one, the next
ones get a new site. The files of a site (recordings, forces written to the devices, logs) are kept in the folder of the
results until all checks on them hold.
"""

import shutil
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import groupby
from math import isnan
from operator import attrgetter
from pathlib import Path

from evidence.faults import attack_cases
from evidence.faults.cases import DEVICES, LINKS, MACHINES, PARTS, PEERS, PROCESSES, Case
from evidence.faults.checks import UNDISTURBED_NS, Falls, disturbed, fades_of, largest_step, verdict_of
from evidence.faults.evidence import Evidence, Window, gather
from evidence.faults.rigs import until_forces, until_undisturbed
from evidence.faults.sites import Setup, Site, open_site
from netboard.base.clock import now_ns
from netboard.base.errors import ConfigError, NetboardError
from netboard.base.terminal.output import FittedTable, plain_console
from netboard.benchmarks.harness.results import BenchVerdict, Folder, ResultPart, Value
from netboard.benchmarks.harness.running import Options, Tell, run

COLUMNS = (
    *("case", "falls after [ms]", "zero after [ms]", "largest step / limit [1]"),
    *("pauses [1]", "ticks lost [1]", "check", "holds"),
)

RECOVERY_S = 90.0
"""Longest time until a trial runs again after a fault [s]."""

DETECTION_S = 0.2
"""Longest time until the end of a fault is detected [s]."""

AFTER_S = 0.5
"""Time after recovery that still belongs to the fault [s]."""

PAUSES_BEFORE = "pauses while a trial was waited for"
"""Name of the number of pauses before the fault could be injected."""

MAX_REPETITIONS = 3
"""Most repetitions of a case that the machine disturbed [1]."""

TellCase = Callable[[str], object]

CASES: tuple[Case, ...] = (*PROCESSES, *LINKS, *PEERS, *DEVICES, *MACHINES, *attack_cases.ATTACKS)
"""All fault cases."""

QUICK = (
    *("agent-killed", "no-hello", "device-jumps"),
    *("line-held-200ms", "line-cut-20ms"),
    "server-killed",
    "logger-killed",
)
"""Cases of the short form: processes, links, peers and devices, in few sites, because starting them takes most of the
time."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case.

    - `verdicts`: the checks and their results; empty if the case could not be run.
    - `disturbed`: reason of a pause by the machine itself just before the fault, or empty.
    - `repetitions`: number of repetitions because of that [1].
    """

    case: Case
    verdicts: tuple[BenchVerdict, ...] = ()
    figures: tuple[Value, ...] = ("", "", "", "", "", "")
    facts: tuple[tuple[str, str], ...] = ()
    refusal: str = ""
    disturbed: str = ""
    repetitions: int = 0

    @property
    def holds(self) -> bool:
        """Return whether every check that could be made holds."""
        return all(verdict.holds for verdict in self.verdicts)


def main(names: Sequence[str], options: Options) -> int:
    """Inject faults and check the reactions."""
    chosen = choose(names, quick=options.quick)
    outcomes: list[Outcome] = []
    results: dict[str, object] = {}

    def study(folder: Folder, tell: Tell, *, quick: bool) -> Iterator[ResultPart]:
        def tell_case(name: str) -> None:
            tell(name, len(outcomes) / len(chosen))

        for outcome in run_all(chosen, folder.path / "sites", quick, tell_case):
            outcomes.append(outcome)
            results.update(about(outcomes, quick))
            folder.write(parts_of(outcomes), results)
        yield from parts_of(outcomes)

    verdicts = run("faults", study, options, results)
    console = plain_console()
    console.print(f"{sum(bool(outcome.refusal) for outcome in outcomes)} cases could not be run")
    console.print(repetitions_line(outcomes))
    return 0 if all(verdict.holds for verdict in verdicts) else 1


def choose(names: Sequence[str], *, quick: bool) -> list[Case]:
    """Find cases by name."""
    by_name = {case.name: case for case in CASES}
    if unknown := [name for name in names if name not in by_name]:
        raise ConfigError(f"--case {unknown[0]}: there is no such case; faults --list shows all")
    return [by_name[name] for name in names] or [case for case in CASES if case.name in QUICK or not quick]


def repetitions_line(outcomes: Sequence[Outcome]) -> str:
    """Report how often the machine itself paused a trial before a fault could be made."""
    names = [f"{outcome.case.name} ({outcome.repetitions})" for outcome in outcomes if outcome.repetitions]
    total = sum(outcome.repetitions for outcome in outcomes)
    line = f"Repeated, because the machine had paused the trial before the fault: {total} times"
    return f"{line}: {', '.join(names)}" if names else line


def list_cases() -> int:
    """Print the table of cases; exit code 0."""
    console = plain_console()
    for part, title in PARTS.items():
        table = FittedTable("case", "what is done", "what must happen", title=title)
        for case in CASES:
            if case.part == part:
                table.add_row(case.name, case.done, case.expected)
        console.print(table)
    return 0


def run_all(cases: Sequence[Case], folder: Path, quick: bool, tell: TellCase) -> Iterator[Outcome]:
    """Run cases, grouped by the site that they need."""
    for setup, group in groupby(sorted(cases, key=attrgetter("setup.name")), attrgetter("setup")):
        waiting = list(group)
        if refusal := setup.refusal():
            yield from (Outcome(case, refusal=refusal) for case in waiting)
            continue
        repetitions: Counter[str] = Counter()
        while waiting:
            first = waiting[0]
            site_folder = folder / f"{first.name}{'-again' * repetitions[first.name]}"
            cases_of_site = [first] if first.alone else [case for case in waiting if not case.alone]
            outcomes = without_repeated(run_in_site(setup, cases_of_site, site_folder, quick, tell), repetitions)
            yield from outcomes
            if all(outcome.holds for outcome in outcomes):
                shutil.rmtree(site_folder)
            done = {outcome.case.name for outcome in outcomes}
            waiting = [case for case in waiting if case.name not in done]


def without_repeated(outcomes: Sequence[Outcome], repetitions: Counter[str]) -> list[Outcome]:
    """Return the outcomes without the cases that must be repeated, because the machine had paused the trial.

    - `repetitions`: number of repetitions of each case, updated.
    """
    kept = []
    for outcome in outcomes:
        name = outcome.case.name
        if outcome.disturbed and repetitions[name] < MAX_REPETITIONS:
            repetitions[name] += 1
        else:
            kept.append(replace(outcome, repetitions=outcome.repetitions + repetitions[name]))
    return kept


def run_in_site(setup: Setup, cases: Sequence[Case], folder: Path, quick: bool, tell: TellCase) -> list[Outcome]:
    """Run cases in one site, up to the first after which the site does not recover."""
    tell(f"{cases[0].name}: starting")
    with open_site(setup, folder, quick=quick) as site:
        windows: list[Window] = []
        try:
            site.start()
        except NetboardError as error:
            return [Outcome(case, (BenchVerdict("a trial begins", False, str(error)),)) for case in cases]
        for case in cases:
            tell(case.name)
            windows.append(inject(case, site))
            if windows[-1].trouble:
                break
        else:
            windows[-1] = _shut_down(site, windows[-1])
        site.end()
        tell(f"{cases[0].name}: checking")
        found = gather(site, windows)
    return [
        _with_relative_paths(folder, evaluate(case, evidence)) for case, evidence in zip(cases, found, strict=False)
    ]


def _with_relative_paths(folder: Path, outcome: Outcome) -> Outcome:
    """Prefix an outcome's file names with the folder of its site."""
    outside = f"{folder.resolve()}/"
    return replace(
        outcome,
        verdicts=tuple(replace(verdict, found=verdict.found.replace(outside, "")) for verdict in outcome.verdicts),
        facts=tuple((name, fact.replace(outside, "")) for name, fact in outcome.facts),
    )


def _shut_down(site: Site, last: Window) -> Window:
    """Shut everything down in order; return the last window, with any trouble of the shutdown."""
    try:
        site.finish()
    except NetboardError as error:
        return replace(last, trouble=str(error))
    return last


def inject(case: Case, site: Site) -> Window:
    """Inject a fault while a trial runs, and wait until a trial runs again."""
    start_ns = now_ns()
    facts: dict[str, str] = {}
    try:
        pauses = until_undisturbed(site.rig, UNDISTURBED_NS * 1e-9, RECOVERY_S)
        start_ns = now_ns()
        if pauses:
            facts[PAUSES_BEFORE] = str(pauses)
        facts.update(case.action(site) or {})
        site.sleep(DETECTION_S)
        until_forces(site.rig, RECOVERY_S)
    except (NetboardError, OSError) as error:
        return Window(start_ns, now_ns(), facts, f"{type(error).__name__}: {error}")
    site.sleep(AFTER_S)
    return Window(start_ns, now_ns(), facts)


def evaluate(case: Case, evidence: Evidence) -> Outcome:
    """Check the evidence of a case."""
    verdicts = tuple(check(evidence) for check in case.all_checks)
    found = attack_cases.figures(evidence) if case.part == attack_cases.PART else figures(case, evidence)
    facts = evidence.window.facts
    pauses = int(facts.get(PAUSES_BEFORE, "0"))
    return Outcome(case, verdicts, found, tuple(facts.items()), disturbed=disturbed(evidence), repetitions=pauses)


def figures(case: Case, evidence: Evidence) -> tuple[Value, ...]:
    """Return the figures of a case: the columns after its name in the table."""
    sides = {side for check in case.checks if isinstance(check, Falls) for side in check.sides}
    fades = [found[0] for side in sides if (found := fades_of(evidence, side))]
    return (
        max((fade.begun * 1e3 for fade in fades), default=""),
        max((fade.zero * 1e3 for fade in fades if not isnan(fade.zero)), default=""),
        largest_step(evidence, case.cut),
        len(evidence.pauses),
        evidence.rig.lost_ticks,
        verdict_of(evidence),
    )


def parts_of(outcomes: Sequence[Outcome]) -> list[ResultPart]:
    """Write outcomes as tables."""
    order = [case.name for case in CASES]
    found = []
    for part, title in PARTS.items():
        mine = sorted((o for o in outcomes if o.case.part == part), key=lambda o: order.index(o.case.name))
        if mine:
            columns = attack_cases.COLUMNS if part == attack_cases.PART else COLUMNS
            rows: list[tuple[Value, ...]] = [(o.case.name, *_padded(o, len(columns) - 2), _holds_text(o)) for o in mine]
            found.append(ResultPart(part, title, columns, rows, [_verdict(o) for o in mine if not o.refusal]))
    return found


def _padded(outcome: Outcome, count: int) -> tuple[Value, ...]:
    """Return the figures of an outcome, with empty values if the case was not run."""
    return outcome.figures if len(outcome.figures) == count else ("",) * count


def _holds_text(outcome: Outcome) -> str:
    if outcome.refusal:
        return f"not run: {outcome.refusal}"
    return "yes" if outcome.holds else "NO"


def _verdict(outcome: Outcome) -> BenchVerdict:
    """Return a case that was run as one checked claim, with its failures or results."""
    claim = f"{outcome.case.name}: {outcome.case.done}: {outcome.case.expected}"
    failed = [verdict for verdict in outcome.verdicts if not verdict.holds]
    if failed:
        return BenchVerdict(claim, False, "; ".join(f"NOT {verdict.claim}: {verdict.found}" for verdict in failed))
    repeated = f"; repeated {outcome.repetitions} times" if outcome.repetitions else ""
    return BenchVerdict(claim, True, "; ".join(verdict.found for verdict in outcome.verdicts) + repeated)


def about(outcomes: Sequence[Outcome], quick: bool) -> dict[str, object]:
    """Return all results for the JSON file."""
    cases = [
        {
            "name": outcome.case.name,
            "done": outcome.case.done,
            "expected": outcome.case.expected,
            "site": outcome.case.setup.name,
            "refusal": outcome.refusal,
            "prepared_again": outcome.repetitions,
            "verdicts": [asdict(verdict) for verdict in outcome.verdicts],
            "facts": dict(outcome.facts),
        }
        for outcome in outcomes
    ]
    return {"study": "faults", "quick": quick, "cases": cases}
