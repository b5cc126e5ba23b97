"""Tables of measurements in the pages: which study's, where, and how they are written.

The results are those of `make evidence`, `netboard bench`, `netboard power` and `netboard participants fit`, copied
unchanged to docs/data/. `docs/generate.py` puts them between their marks.
"""

import json
import re
import textwrap
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

DOCS = Path(__file__).resolve().parent


class Shown(NamedTuple):
    """Tables of one study in one page; their marks are named by ``prefix`` and table."""

    study: str  # its file in docs/data
    page: str
    prefix: str = ""
    tables: str = ""  # their names, with spaces between
    machine: str = ""  # mark of the machine that the study ran on
    title: str = ""  # begins the title of each table


STUDIES = (
    Shown("analysis", "explanation/analysis-speed.md", "analysis-",
          "costs scaling memory whole tasks again", "analysis machine"),
    Shown("attacks", "explanation/faults.md", "", "attacks", "attacks machine"),
    Shown("calibration", "explanation/analysis-calibration.md", "calibration-",
          "about false-positives power interaction variations differences effect-sizes", "calibration machine"),
    Shown("controls", "explanation/analysis-controls.md", "controls ", "parts", "controls machine"),
    Shown("coupling", "explanation/coupling.md", "coupling-",
          "delays limits releases remedies transparency everyday", "coupling machine"),
    Shown("decisions", "explanation/robots.md", "robots ", "decisions", "robots decisions machine"),
    Shown("dyads", "explanation/latency.md", "loop-", "scale shared waiting", "dyads machine"),
    Shown("faults", "explanation/faults.md", "", "processes links peers devices machines", "faults machine"),
    Shown("environments", "how-to/environments.md", "environments ",
          "speed policies differences", "environments machine"),
    Shown("fit", "explanation/participants-fit.md", "fit ", "summaries parameters recovery fit"),
    Shown("forces", "explanation/forces.md", "forces ", "conditions"),
    Shown("information", "explanation/participants-information.md", "information ",
          "scenes models filters hands senses skills acquaintance"),
    Shown("live", "explanation/robots.md", "robots ", "live", "robots live machine"),
    Shown("loop", "explanation/latency.md", "loop-", "ratios latency lateness costs", "loop machine"),
    Shown("loop-touch", "explanation/latency.md", "touch-", "ratios latency costs", title="A Touch (stand-in): "),
    Shown("participants", "explanation/participants.md", "participants ",
          "predictions order models ablations differences slowing", "participants machine"),
    Shown("participants", "explanation/participants-model.md", "participants ", "others rest"),
    Shown("participants", "explanation/participants-fit.md", "participants ",
          "posterior posterior-models posterior-differences"),
    Shown("partner-pairs", "explanation/partners.md", "partner-pairs ", "matrix"),
    Shown("partners", "explanation/partners.md", "partners ", "performance coordination haptics"),
    Shown("physics", "explanation/accuracy.md", "",
          "expect left-out growth holds frontier ratios-physics mujoco tick", "machine"),
    Shown("power", "how-to/plan-a-study-size.md", "power-", "about power false-positives precision"),
    Shown("recording", "explanation/recording.md", "recording-",
          "size columns headroom writing stalls reading", "recording machine"),
    Shown("recovery", "explanation/recovery.md", "recovery-", "damage kills", "recovery machine"),
    Shown("rehearsals", "how-to/rehearse.md", "rehearsals ", "speed cohort", "rehearsals machine"),
    Shown("robots", "explanation/robots.md", "robots ", "completion stability"),
    Shown("sensitivity", "explanation/analysis-sensitivity.md", "sensitivity-",
          "about readings pairs concerned paths statements disturbances forms", "sensitivity machine"),
    Shown("sensitivity", "reference/measures.md", "sensitivity-", "headlines"),
    Shown("soak", "explanation/latency.md", "soak-", "records memory minutes costs", "soak machine"),
    Shown("stability", "explanation/stability.md", "",
          "tick-limits map-coupling-summary map-inertia-summary stiff-forces large-tilts energy-drift "
          "ball-at-ends perfect-rest odd-hands soak", "stability machine"),
    Shown("startup", "explanation/startup.md", "startup ", "commands session demo", "startup machine"),
    Shown("taylor", "explanation/accuracy.md", "taylor-",
          "ratios-dense ratios-physics spacing sampled trials lanes stress", "taylor machine"),
    Shown("triggers", "how-to/triggers.md", "triggers-", "latency", "triggers machine"),
    Shown("truth", "explanation/analysis-evidence.md", "", "truth", "truth machine"),
    Shown("velocity", "explanation/velocity.md", "", "estimators delays", "velocity machine"),
)  # fmt: skip
"""What the pages show of each study."""


def cell(text: str) -> str:
    """Make text safe inside a cell of a Markdown table."""
    return re.sub(r"\s+", " ", text).replace("|", "\\|")


def part_of(study: str, name: str) -> Any:
    """Return one table of a study's results."""
    parts = json.loads((DOCS / "data" / f"{study}.json").read_text(encoding="utf-8"))["parts"]
    return next(part for part in parts if part["name"] == name)


def study_part(study: str, name: str, of: str = "") -> Callable[[], str]:
    """Return what writes one table of a study, and what follows from it. ``of``: begins its title."""

    def write() -> str:
        part = part_of(study, name)
        lines = [f"*{of}{part['title']}*", "", "| " + " | ".join(map(cell, part["columns"])) + " |"]
        lines += ["|" + "---|" * len(part["columns"])]
        lines += ["| " + " | ".join(map(_figure, row)) + " |" for row in part["rows"]]
        lines += [""] if part["verdicts"] else []
        lines += [f"- {_verdict(verdict)}" for verdict in part["verdicts"]]
        return "\n".join(lines)

    return write


def _verdict(verdict: dict[str, Any]) -> str:
    """Write a claim, whether it holds, and the figures."""
    return f"{'Holds' if verdict['holds'] else '**Fails**'}: {cell(verdict['claim'])}: {cell(verdict['found'])}"


def _figure(value: Any) -> str:
    """Write a value of a table: numbers to three digits, as on the screen."""
    return f"{value:.3g}" if isinstance(value, float) else cell(str(value))


def study_machine(study: str) -> Callable[[], str]:
    """Return what writes the machine that a study ran on."""

    def write() -> str:
        machine = json.loads((DOCS / "data" / f"{study}.json").read_text(encoding="utf-8"))["machine"]
        libraries = ", ".join(f"{name} {number}" for name, number in machine["libraries"].items())
        where = f"{machine['cpu']}, {machine['cores']} cores, {machine['system']}"
        return f"{where}, Python {machine['python']}; {libraries}."

    return write


def loop_in_short() -> str:
    """Write what the loop can do on the machine on which it was measured, as two limits of the README."""

    def column(part: str, name: str, study: str = "loop") -> dict[Any, Any]:
        table = part_of(study, part)
        return {row[0]: row[table["columns"].index(name)] for row in table["rows"]}

    def latencies(study: str, name: str) -> list[float]:
        found = column("ratios", name, study)
        return [found[f"sample to force / echo, {at} [1]"] for at in ("50 %", "99 %", "99.9 %")]

    touch, simulated = (latencies(study, "median") for study in ("loop-touch", "loop"))
    ends = [latencies("loop-touch", end) for end in ("least", "largest")]
    ranges = [f"{a:.2f} to {b:.2f}" for a, b in zip(*ends, strict=True)]
    server = column("ratios", "median", "loop-touch")["CPU of the server / echo [1]"]
    held = column("scale", "holds", "dyads")
    dyads = max(number for number, holds in held.items() if holds)
    of_core = column("scale", "all [%]", "dyads")[dyads]
    limits = f"""
It is not hard real time.** Python on a stock kernel misses some deadlines of the 1 kHz loop; every deadline miss is
counted and recorded. The sample-to-force latency was compared with a minimal ZeroMQ round trip with messages of the
same size, with server, agents and logger on one virtual machine of two cores. Each ratio is netboard's latency divided
by that of the round trip; below 1, netboard is faster. For a Touch the ratio of the medians
was {touch[0]:.2f} (single rounds: {ranges[0]}), of the 99 % quantiles {touch[1]:.2f} ({ranges[1]}), and of the 99.9 %
quantiles {touch[2]:.2f} ({ranges[2]}). For the simulated device the ratios were {simulated[0]:.2f}, {simulated[1]:.2f}
and {simulated[2]:.2f} ([all results](docs/explanation/latency.md)). The Touch was a stand-in for the vendor's library;
nothing has been measured on a real one, whose servo adds up to 1 ms in each direction. If no sample arrives for 50 ms,
the server pauses the trial. The operator resumes it, or with `--autostart` the server itself. Measure your own machines
with `netboard doctor` and `netboard bench loop`.

One core serves {dyads} dyads** ({of_core:.0f} % of the core). With agents and logger on the same machine, the server of
one dyad uses {server:.1f} times the CPU time of the minimal round trip."""
    return "\n".join(
        textwrap.fill(limit.strip(), 127, initial_indent="- **", subsequent_indent="  ")
        for limit in limits.split("\n\n")
    )


def study_tables() -> dict[str, tuple[str, Callable[[], str]]]:
    """Return the page of each mark, and what writes its table or its machine."""
    made: dict[str, tuple[str, Callable[[], str]]] = {}
    for study, page, prefix, names, machine, title in STUDIES:
        made |= {f"{prefix}{name}": (page, study_part(study, name, title)) for name in names.split()}
        made |= {machine: (page, study_machine(study))} if machine else {}
    return made
