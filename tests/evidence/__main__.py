"""Run one item of the evidence: ``make evidence ARGS="faults --quick"``, or ``PYTHONPATH=tests python -m evidence``.

An item and its libraries are imported only when it runs.
"""

from functools import partial
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.services.bench.options import benchmark
from netboard.services.guard import Guarded
from netboard.services.options import Workers

if TYPE_CHECKING:
    from netboard.benchmarks.harness.running import BenchStudy, Options

app = typer.Typer(
    cls=Guarded,
    name="evidence",
    help='Evidence for netboard. Run an item with: make evidence ARGS="ITEM --quick".',
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["--help", "-h"]},
)


@app.callback()
def root(
    debug: Annotated[bool, typer.Option("--debug", help="Show the full traceback of errors.")] = False,
) -> None:
    """Take the option that goes before the item; `Guarded` reads it."""


PLAIN = {
    "stability": ("stability.bench", "Stability of the methods: theory, runs, corrupted samples, 1e9 random steps."),
    "taylor": (
        "physics.taylor_bench",
        "The Taylor method of offline simulations: kept states beside heyoka, sampled hands, and stress.",
    ),
    "velocity": ("stability.velocity", "Estimators of stylus velocity: lag, noise, cost, and largest stable delay."),
    "coupling": (
        "coupling.bench",
        "Maximum stable delay of the virtual coupling, and what extends it.",
    ),
    "forces": ("coupling.forces", "Forces on both hands for one movement under each force condition."),
    "rehearsals": ("participants.speed", "Speed of rehearsals on one core, beside the stage alone, in the same run."),
    "robots": (
        "participants.robots",
        "Robot partners: completion times beside other partners, and stable latencies.",
    ),
    "decisions": ("participants.decisions", "Time of a robot partner's decision, called once a millisecond."),
    "partners": ("participants.partners", "Participants beside every kind of partner, haptic feedback on and off."),
    "live": ("participants.live", "Robot partners in real processes: a session each, verified, timed and analysed."),
    "partner-pairs": ("participants.partner_pairs", "Each two robot partners beside each other."),
    "looks": ("looks.study", "Screenshots of every state of every window, and whether all text and keys are there."),
    "calibration": ("analysis.calibration", "False positive rate of the tests in simulated studies."),
    "controls": (
        "analysis.control_truth",
        "Parts of the effects of haptic feedback on simulated dyads of known truth.",
    ),
    "truth": ("analysis.ground_truth_bench", "Errors of the measures on trials whose true values are known."),
    "recovery": (
        "recording.recovery_bench",
        "Recovery of recordings that were cut or altered, checked to the bit.",
    ),
}
"""Items without options of their own: the module of the `study` of each, and what it shows."""


def _register(name: str, module: str, text: str) -> None:
    def item(options: "Options") -> int:
        from netboard.benchmarks.harness.running import run

        study: BenchStudy = import_module(f"evidence.{module}").study
        return 0 if all(verdict.holds for verdict in run(name, study, options)) else 1

    item.__name__, item.__doc__ = name, text
    benchmark(app, f'make evidence ARGS="{name} --quick"')(item)


for _name, (_module, _text) in PLAIN.items():
    _register(_name, _module, _text)


@benchmark(app, 'make evidence ARGS="physics --peers heyoka -o results"')
def physics(
    options: "Options",
    peers: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Compare only with these libraries, for example heyoka,mujoco.")
    ] = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="Compare with no other library.")] = False,
    model: Annotated[
        Literal["paper", "lagrangian"] | None, typer.Option(help="Only the equations of this model.")
    ] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Repetitions of each timing.")] = None,
) -> None:
    """Work and precision of the integration methods, compared with other libraries; errors of sampling."""
    from evidence.physics import bench

    bench.main(options, peers=[] if no_peers else peers.split(",") if peers else None, model=model, repeats=repeats)


@benchmark(app, 'make evidence ARGS="dyads --dyads 1,2,4,8,16"')
def dyads(
    options: "Options",
    dyads: Annotated[str | None, typer.Option(metavar="NUMBERS", help="Numbers of dyads; default: 1,2,4,6,8.")] = None,
) -> None:
    """Cost and tick jitter of a server by its number of dyads, with lightweight peers."""
    from evidence.loop import bench

    bench.main(dyads, options)


@benchmark(app, 'make evidence ARGS="faults --quick"', 'make evidence ARGS="faults --case server-killed -o results"')
def faults(
    options: "Options",
    case: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this fault; repeat for several.")] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the faults, and stop.")] = False,
) -> int:
    """Faults in real processes (kill, stop, cut the network, fill the disk), attacks, and how the system reacts."""
    from evidence.faults import bench

    return bench.list_cases() if listing else bench.main(case or (), options)


@benchmark(app, 'make evidence ARGS="fuzz --frames 1000000 -o results"')
def fuzz(
    options: "Options",
    frames: Annotated[
        int | None,
        typer.Option(min=100, metavar="N", help="Malformed frames per codec and socket; default: a million."),
    ] = None,
) -> int:
    """Malformed frames for the codec and every socket: no crash, no hang, no growth, no changed force."""
    from evidence.faults.fuzz import main

    return main(frames, options)


@benchmark(app, 'make evidence ARGS="files --quick"')
def files(options: "Options") -> int:
    """Files that are well formed and lie, for every command that opens them: it ends, and says what is wrong."""
    from evidence.fuzz import hostile_files

    return hostile_files.main(options)


@benchmark(app, 'make evidence ARGS="participants --studies 16"')
def participants(
    options: "Options",
    studies: Annotated[
        int | None, typer.Option(min=2, metavar="N", help="Virtual studies of four dyads; default: 48.")
    ] = None,
    workers: Workers = None,
) -> None:
    """Compare the simulated participants, and variants that lack one part, with the paper's results."""
    from evidence.participants.bench import study
    from netboard.benchmarks.harness.running import run

    run("participants", partial(study, studies, workers), options)


@benchmark(app, 'make evidence ARGS="information --quick"')
def information(
    options: "Options",
    dyads: Annotated[
        int | None, typer.Option(min=2, metavar="N", help="Simulated dyads in each scene; default: 16.")
    ] = None,
    workers: Workers = None,
) -> int:
    """What the force tells simulated partners, and what it is worth, by stiffness, damping, friction and skill."""
    from evidence.participants.information import study
    from netboard.benchmarks.harness.running import run

    verdicts = run("information", partial(study, dyads, workers), options)
    return 0 if all(verdict.holds for verdict in verdicts) else 1


Recordings = Annotated[
    Path | None, typer.Argument(metavar="[DIR]", help="Recordings of a study; default: rehearse the paper's plan.")
]


@benchmark(app, 'make evidence ARGS="sensitivity recordings -o results"')
def sensitivity(options: "Options", recordings: Recordings = None) -> None:
    """Sensitivity of each measure to settings, noise and lost samples."""
    from evidence.analysis import sensitivity_bench

    sensitivity_bench.main(recordings, options)


@benchmark(app, 'make evidence ARGS="analysis --quick"')
def analysis(
    options: "Options",
    recordings: Recordings = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes; default: one per core, or one for a small study."),
    ] = None,
) -> None:
    """Cost of analysing a study: time and memory against its size, with and without the cache."""
    from evidence.analysis import speed_bench

    speed_bench.main(recordings, workers, options)


if __name__ == "__main__":
    app()
