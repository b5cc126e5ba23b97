"""Benchmarks and studies: ``netboard bench``.

A benchmark is a row of `BENCHMARKS`; it and its libraries are imported only when it runs.
"""

from collections.abc import Callable, Sequence
from importlib import import_module
from inspect import Parameter, Signature
from pathlib import Path
from typing import Any, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services import options
from netboard.services.options import examples

app = typer.Typer(
    help="Measure netboard on this machine: the physics, the loop from stylus to force, long runs.",
    no_args_is_help=True,
)


def option(name: str, kind: Any, default: Any, *flags: str, **details: Any) -> Parameter:
    """Return an option as a parameter of a command."""
    return Parameter(name, Parameter.KEYWORD_ONLY, annotation=kind, default=typer.Option(default, *flags, **details))


def flag(name: str, words: str, *flags: str) -> Parameter:
    """Return an option that is on or off."""
    return option(name, bool, False, *(flags or (f"--{name.replace('_', '-')}",)), help=words)


def number(name: str, least: float, metavar: str | None, words: str, kind: type = float) -> Parameter:
    """Return an option with a number that has no fixed default."""
    return option(name, kind | None, None, min=least, metavar=metavar, help=words)


def text(name: str, metavar: str, words: str, default: str | None = None) -> Parameter:
    """Return an option with text."""
    return option(name, str if default is not None else str | None, default, metavar=metavar, help=words)


OUTPUT = option(
    "output",
    Path | None,
    None,
    "--output",
    "-o",
    metavar="DIR",
    help="Folder for the results; default: a new one here.",
)
QUICK = flag("quick", "Short version, in less than a minute.")
FORCE = flag("force", "Write into an existing folder.")
JSON = option("json", Path | None, None, "--json", metavar="FILE", help="Also write the results there, as JSON.")
PLAIN = (OUTPUT, QUICK, FORCE)
"""Options of every benchmark."""
STUDY = (*PLAIN, JSON)
PROCESSES = (
    option("transport", Literal["tcp", "ipc"], "tcp", help="Transport of the messages."),
    flag("curve", "Encryption with keys.", "--curve/--no-curve"),
    option("real_time", bool, True, "--realtime/--no-realtime", help="Real-time scheduling."),
    option("displays", int, 0, min=0, metavar="N", help="Displays per dyad, rendered without a screen."),
)
"""Options of benchmarks that run the processes of a lab."""


def main(place: str) -> Callable[..., Any]:
    """Return a function that imports another one, named as ``room.module:function``, and calls it."""
    module, _, name = place.partition(":")

    def run(*given: Any, **named: Any) -> Any:
        return getattr(import_module(f"netboard.benchmarks.{module}"), name)(*given, **named)

    return run


def study(name: str, place: str, *, strict: bool = False) -> Callable[..., int]:
    """Return a function that runs a study with the usual options; a failed claim is an error only if `strict`."""
    return lambda **given: _run(name, main(place), strict=strict, **given)


def _run(name: str, made: Callable[..., Any], *, strict: bool = False, **given: Any) -> int:
    """Run a study; a claim that fails is usually a result, so the exit code is 0."""
    from netboard.benchmarks.harness.running import run_named

    verdicts = run_named(name, made, **given)
    return 1 if strict and not all(verdict.holds for verdict in verdicts) else 0


def _participants(*, studies: int, dyads: int | None, workers: int | None, **given: Any) -> int:
    made = import_module("netboard.benchmarks.participants.bench").study(studies, dyads, workers)
    return _run("participants", made, **given)


def _physics(*, peers: str | None, no_peers: bool, **given: Any) -> Any:
    names = [] if no_peers else peers.split(",") if peers else None
    return main("physics.bench:main")(peers=names, **given)


def _faults(*, case: list[str] | None, listing: bool, **given: Any) -> Any:
    return main("faults.bench:list_cases")() if listing else main("faults.bench:main")(names=case or (), **given)


def _display(*, config: Path | None, overrides: list[str] | None, **given: Any) -> Any:
    return main("loop.display:main")(config=options.load(config, overrides), **given)


def _analysis(
    *, recordings: Path | None, workers: int | None, sensitivity: bool, calibration: bool, truth: bool, **given: Any
) -> Any:
    """Measure the cost of an analysis, or run one of the studies of it instead."""
    alone = not (sensitivity or recordings is not None or workers is not None)
    if calibration and (truth or not alone):
        raise ConfigError(
            "--calibration: found with recordings, --sensitivity, --truth or --workers; it simulates its own studies"
        )
    if truth and not alone:
        raise ConfigError("--truth: found with recordings, --sensitivity or --workers; it makes its own trials")
    if sensitivity and workers is not None:
        raise ConfigError("--workers: found with --sensitivity, which uses all cores; leave it out")
    if calibration:
        return study("calibration", "analysis.calibration:study")(**given)
    if truth:
        return study("truth", "analysis.ground_truth_bench:study")(**given)
    if sensitivity:
        return import_module("netboard.services.sensitivity").main(recordings, **given)
    main("analysis.speed_bench:main")(given=recordings, workers=workers, **given)
    return 0


USUAL = ("--quick", "-o results")
"""Examples of the options of most benchmarks."""


def _add(
    name: str, run: Callable[..., Any], words: str, parameters: Sequence[Parameter], lines: Sequence[str] = USUAL
) -> None:
    """Add a benchmark as a command."""

    def command(**given: Any) -> None:
        raise typer.Exit(run(**given) or 0)

    # Typer reads the options of a command from its signature and its annotations.
    command.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    command.__annotations__ = {one.name: one.annotation for one in parameters}
    app.command(name, help=words, epilog=examples(*(f"netboard bench {name} {line}" for line in lines)))(command)


_add(
    "stability",
    main("stability.bench:main"),
    "Stability of the integration methods: theory, nonlinear runs, stiff scenes and unusual hands.",
    (*PLAIN, flag("soak", "Also step 1e9 times through random scenes.")),
    ("--quick", "--soak -o results"),
)
_add(
    "velocity",
    study("velocity", "stability.velocity:study"),
    "Estimators of stylus velocity: lag, noise, computing time, and the largest stable delay with each.",
    STUDY,
)
_add(
    "physics",
    _physics,
    "Work and precision of the integration methods, compared with other libraries.\n\n"
    "It also measures the cost of a tick and of sampling, and what simple scenes save.",
    (
        *PLAIN,
        text("peers", "NAMES", "Compare only with these libraries, for example heyoka,mujoco."),
        flag("no_peers", "Compare with no other library."),
        option("model", Literal["paper", "lagrangian"] | None, None, help="Only the equations of this model."),
        number("repeats", 1, None, "Repetitions of each timing.", int),
    ),
    ("--quick", "--peers heyoka -o results"),
)
_add(
    "loop",
    main("loop.bench:loop"),
    "Sample-to-force latency in real time, compared with a bare echo and a bare timer: latency, jitter, cost.",
    (
        *STUDY,
        number("seconds", 0.5, "S", "Seconds per measurement; default: 60."),
        *PROCESSES,
        text("dyads", "NUMBERS", "Also load a server with these numbers of dyads, as 1,2,4,8."),
        flag("skips", "Also measure the savings in simple scenes."),
    ),
    ("--quick", "--displays 2 --dyads 1,2,4,8,16 --skips"),
)
_add(
    "servo",
    main("loop.servo:main"),
    "Servo callback of a Touch in Python and in C, compared with an empty callback, with and without a busy thread.",
    (
        *STUDY,
        text("library", "FILE", "The vendor's library; default: libHD.so or HD.dll of the system.", ""),
        number("seconds", 0.2, "S", "Seconds per measurement; default: 30."),
    ),
    ("--quick", "--library /opt/libHD.so -o results"),
)
_add(
    "soak",
    main("loop.bench:soak"),
    "Long run of the whole system: no record is lost, memory stays constant, ticks meet their deadlines.",
    (
        *STUDY,
        number("minutes", 0.05, "N", "Duration in minutes; default: 30."),
        option("dyads", int, 1, min=1, metavar="N", help="Number of dyads."),
        *PROCESSES,
    ),
    ("--minutes 30", "--quick --dyads 2"),
)
_add(
    "coupling",
    study("coupling", "coupling.bench:study"),
    "Maximum stable delay of the virtual coupling: theory, the simulated service, and what extends it.",
    STUDY,
)
_add(
    "forces",
    study("forces", "coupling.forces:study"),
    "Forces on both hands for one movement under each of the six force conditions, as a figure and a table.",
    STUDY,
)
_add(
    "participants",
    _participants,
    "Which of the paper's results the simulated participants reproduce, and without which part they do not.",
    (
        *STUDY,
        option("studies", int, 200, min=1, metavar="N", help="Virtual studies of four dyads."),
        number("dyads", 4, "N", "Dyads from which the studies are drawn, a multiple of 4; default: 16.", int),
        number("workers", 1, "N", "Processes; default: one per core.", int),
    ),
    ("--quick", "--studies 200"),
)
_add(
    "fuzz",
    main("faults.fuzz:main"),
    "Malformed frames for the codec and every socket: no crash, no hang, no growth, no changed force.",
    (*PLAIN, number("frames", 100, "N", "Malformed frames per codec and socket; default: a million.", int)),
    ("--quick", "--frames 1000000 -o results"),
)
_add(
    "faults",
    _faults,
    "Faults in real processes (kill, stop, cut the network, fill the disk), and how the system reacts.",
    (
        OUTPUT,
        flag("quick", "Short version: fewer faults and shorter waits."),
        FORCE,
        option("case", list[str] | None, None, metavar="NAME", help="Only this fault; repeat for several."),
        flag("listing", "List the faults, and stop.", "--list"),
    ),
    ("--quick", "--case server-killed -o results"),
)
_add(
    "display",
    _display,
    "Latency of a display, from sending a view to painting it: late views, dropped frames, cost.",
    (
        Parameter("config", Parameter.KEYWORD_ONLY, default=None, annotation=options.ConfigFile),
        Parameter("overrides", Parameter.KEYWORD_ONLY, default=None, annotation=options.Overrides),
        *STUDY,
        number("seconds", 1, "S", "Seconds per measurement; default: 30."),
    ),
    ("--quick", "--set display.width=1920"),
)
_add(
    "recovery",
    study("recovery", "recording.recovery_bench:study", strict=True),
    "Recovery of recordings that were cut, altered or killed while being written, checked to the bit.",
    STUDY,
)
_add(
    "recording",
    study("recording", "recording.bench:study"),
    "Cost of recording: headroom and stalls of the logger, bytes per hour, time to read an hour and a trial.",
    STUDY,
)
_add(
    "analysis",
    _analysis,
    "Cost of analysing a study: time and memory against its size, with and without the cache.",
    (
        Parameter(
            "recordings",
            Parameter.KEYWORD_ONLY,
            annotation=Path | None,
            default=typer.Argument(
                None, metavar="[DIR]", help="Recordings of a study; default: rehearse the paper's plan."
            ),
        ),
        flag("sensitivity", "Sensitivity of each measure to settings, noise and lost samples, instead."),
        flag("calibration", "False positive rate of the tests in simulated studies, instead."),
        flag("truth", "Measures of trials whose true values are known, instead."),
        *STUDY,
        number("workers", 1, "N", "Processes; default: one per core, or one for a small study.", int),
    ),
    ("--quick", "recordings/ -o results", "recordings/ --sensitivity", "--calibration --quick", "--truth"),
)
