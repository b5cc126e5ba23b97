"""Benchmarks and studies: ``netboard bench``.

A study and its libraries are imported only when it runs.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services import configuration

if TYPE_CHECKING:
    from netboard.benchmarks.harness.running import Study

app = typer.Typer(
    help="Measure netboard on this machine: the physics, the loop from stylus to force, long runs.",
    no_args_is_help=True,
)

Model = Literal["paper", "lagrangian"]

Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; else a new one here.")
]
Quick = Annotated[bool, typer.Option("--quick", help="A short form, in less than a minute.")]
Force = Annotated[bool, typer.Option("--force", help="Write into a folder that is already there.")]
Json = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the results there too, as JSON.")]
Transport = Annotated[Literal["tcp", "ipc"], typer.Option(help="What carries the messages.")]
Curve = Annotated[bool, typer.Option("--curve/--no-curve", help="With keys and encryption.")]
RealTime = Annotated[bool, typer.Option("--realtime/--no-realtime", help="With real-time scheduling.")]
Displays = Annotated[int, typer.Option(min=0, metavar="N", help="Displays of each dyad, drawn without a screen.")]


def _run(name: str, study: "Study", output: Path | None, json: Path | None, *, quick: bool, force: bool) -> bool:
    """Run a study; return whether all of its verdicts hold."""
    from netboard.benchmarks.harness.running import run_named

    return all(verdict.holds for verdict in run_named(name, study, output, json, quick=quick, force=force))


@app.command(epilog="Examples:\n\n  netboard bench stability --quick\n\n  netboard bench stability --soak -o results")
def stability(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    soak: Annotated[bool, typer.Option("--soak", help="Step 1e9 times through random scenes too.")] = False,
) -> None:
    """Stability of the integration methods: theory, nonlinear runs, stiff scenes and unusual hands."""
    from netboard.benchmarks.stability import bench as study

    raise typer.Exit(study.main(output, quick=quick, force=force, soak_too=soak))


@app.command(epilog="Examples:\n\n  netboard bench velocity --quick\n\n  netboard bench velocity -o results")
def velocity(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Estimators of stylus velocity: lag, noise, computing time, and the largest stable delay with each."""
    from netboard.benchmarks.stability.velocity import study

    _run("velocity", study, output, json, quick=quick, force=force)


@app.command(
    epilog="Examples:\n\n  netboard bench physics --quick\n\n  netboard bench physics --peers heyoka -o results"
)
def physics(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    peers: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Only these libraries beside us, as in heyoka,mujoco.")
    ] = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="No libraries beside us.")] = False,
    model: Annotated[Model | None, typer.Option(help="Only this model's equations.")] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Turns of each in the timing.")] = None,
) -> None:
    """Work and precision of the integration methods, beside other libraries.

    It also measures the cost of a tick and of sampling, and what simple scenes save.
    """
    from netboard.benchmarks.physics import bench as study

    names = [] if no_peers else peers.split(",") if peers else None
    raise typer.Exit(study.main(output, quick=quick, force=force, peers=names, model=model, repeats=repeats))


@app.command(
    epilog="Examples:\n\n  netboard bench loop --quick\n\n  netboard bench loop --displays 2 --dyads 1,2,4,8,16 --skips"
)
def loop(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.5, metavar="S", help="Measure each thing for so long; else a minute.")
    ] = None,
    transport: Transport = "tcp",
    curve: Curve = False,
    realtime: RealTime = True,
    displays: Displays = 0,
    dyads: Annotated[
        str | None,
        typer.Option(metavar="NUMBERS", help="Measure a server of so many dyads too, until it breaks, as in 1,2,4,8."),
    ] = None,
    skips: Annotated[bool, typer.Option("--skips", help="Measure what is saved where less is there, too.")] = False,
) -> None:
    """Sample-to-force latency in real time, beside a bare echo and a bare timer: latency, jitter, cost."""
    from netboard.benchmarks.loop import bench as study

    setting = study.Setting(transport, curve, realtime, displays, quick)
    raise typer.Exit(study.loop(setting, seconds, study.read_dyads(dyads), output, json, skips=skips, force=force))


@app.command(
    epilog="Examples:\n\n  netboard bench servo --quick\n\n  netboard bench servo --library /opt/libHD.so -o results"
)
def servo(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    library: Annotated[
        str,
        typer.Option(metavar="FILE", help="The vendor's library; else libHD.so or HD.dll, where the system finds it."),
    ] = "",
    seconds: Annotated[
        float | None, typer.Option(min=0.2, metavar="S", help="Measure each of six for so long; else half a minute.")
    ] = None,
) -> None:
    """The servo callback of a Touch in Python and in C, beside an empty callback, without and with a busy thread."""
    from netboard.benchmarks.loop import servo as study

    raise typer.Exit(study.main(library, output, json, seconds, quick=quick, force=force))


@app.command(epilog="Examples:\n\n  netboard bench soak --minutes 30\n\n  netboard bench soak --quick --dyads 2")
def soak(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.05, metavar="N", help="For how long; else half an hour.")
    ] = None,
    dyads: Annotated[int, typer.Option(min=1, metavar="N", help="How many dyads.")] = 1,
    transport: Transport = "tcp",
    curve: Curve = False,
    realtime: RealTime = True,
    displays: Displays = 0,
) -> None:
    """Long run of the whole system: no record is lost, memory stays constant, ticks meet their deadlines."""
    from netboard.benchmarks.loop import bench as study

    setting = study.Setting(transport, curve, realtime, displays, quick)
    raise typer.Exit(study.soak(setting, minutes, dyads, output, json, force=force))


@app.command(epilog="Examples:\n\n  netboard bench coupling --quick\n\n  netboard bench coupling -o results")
def coupling(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Maximum stable delay of the virtual coupling: theory beside the simulated service, and what extends it."""
    from netboard.benchmarks.coupling.bench import study

    _run("coupling", study, output, json, quick=quick, force=force)


@app.command(epilog="Examples:\n\n  netboard bench forces --quick\n\n  netboard bench forces -o results")
def forces(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Forces on both hands for one movement under each of the five force conditions, as a figure and a table."""
    from netboard.benchmarks.coupling.forces import study

    _run("forces", study, output, json, quick=quick, force=force)


@app.command(epilog="Examples:\n\n  netboard bench fuzz --quick\n\n  netboard bench fuzz --frames 1000000 -o results")
def fuzz(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    frames: Annotated[
        int | None,
        typer.Option(min=100, metavar="N", help="Malformed ones for the codec, and for each socket; else a million."),
    ] = None,
) -> None:
    """Malformed frames for the codec and every socket: no crash, no hang, no growth, no changed force."""
    from netboard.benchmarks.faults import fuzz as study

    raise typer.Exit(study.main(output, quick=quick, force=force, frames=frames))


@app.command(
    epilog="Examples:\n\n  netboard bench faults --quick\n\n  netboard bench faults --case server-killed -o results"
)
def faults(
    output: Output = None,
    quick: Annotated[bool, typer.Option("--quick", help="A short form: fewer, and less patience.")] = False,
    force: Force = False,
    case: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this one; may be given again.")] = None,
    listing: Annotated[bool, typer.Option("--list", help="Say which faults there are, and stop.")] = False,
) -> None:
    """Faults in real processes (kill, stop, cut the network, fill the disk), and how the system reacts."""
    from netboard.benchmarks.faults import bench as study

    raise typer.Exit(study.list_cases() if listing else study.main(output, quick=quick, force=force, names=case or ()))


@app.command(
    epilog="Examples:\n\n  netboard bench display --quick\n\n  netboard bench display --set display.width=1920"
)
def display(
    config: configuration.ConfigFile = None,
    overrides: configuration.Overrides = None,
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    seconds: Annotated[
        float | None, typer.Option(min=1, metavar="S", help="Measure each of three for so long; else half a minute.")
    ] = None,
) -> None:
    """Latency of a display, from a view's sending to its painting: late views, dropped frames, cost."""
    settings = configuration.load(config, overrides or ())
    from netboard.benchmarks.loop import display as study

    raise typer.Exit(study.main(settings, output, json, seconds, quick=quick, force=force))


@app.command(epilog="Examples:\n\n  netboard bench recovery --quick\n\n  netboard bench recovery -o results")
def recovery(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Recovery of recordings that were cut, altered or killed while being written, checked to the bit."""
    from netboard.benchmarks.recording.recovery_bench import study

    raise typer.Exit(0 if _run("recovery", study, output, json, quick=quick, force=force) else 1)


@app.command(epilog="Examples:\n\n  netboard bench recording --quick\n\n  netboard bench recording -o results")
def recording(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Cost of recording: headroom and stalls of the logger, bytes an hour, time to read an hour and a trial."""
    from netboard.benchmarks.recording.bench import study

    _run("recording", study, output, json, quick=quick, force=force)


@app.command(
    epilog="Examples:\n\n  netboard bench analysis --quick\n\n  netboard bench analysis recordings/ -o results\n\n"
    "  netboard bench analysis recordings/ --sensitivity\n\n  netboard bench analysis --calibration --quick\n\n"
    "  netboard bench analysis --truth"
)
def analysis(
    recordings: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="A study's recordings; else one of the paper's plan is made.")
    ] = None,
    sensitivity: Annotated[
        bool,
        typer.Option("--sensitivity", help="Instead: how far open questions, noise and lost samples move each number."),
    ] = False,
    calibration: Annotated[
        bool,
        typer.Option("--calibration", help="Instead: how often the tests of simulated studies reject, beside .05."),
    ] = False,
    truth: Annotated[
        bool, typer.Option("--truth", help="Instead: the measures of trials whose numbers are known beforehand.")
    ] = False,
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="How many processes measure; else one a core, or one for a small study."),
    ] = None,
) -> None:
    """Cost of analysing a study: time and memory against its size, anew and cached, beside reading the files."""
    alone = not (sensitivity or recordings is not None or workers is not None)
    if calibration and (truth or not alone):
        raise ConfigError(
            "--calibration: found with recordings, --sensitivity, --truth or --workers; it simulates studies alone"
        )
    if truth and not alone:
        raise ConfigError("--truth: found with recordings, --sensitivity or --workers; it makes its own trials")
    if calibration:
        from netboard.benchmarks.analysis.calibration import study as simulations

        _run("calibration", simulations, output, json, quick=quick, force=force)
        return
    if truth:
        from netboard.benchmarks.analysis.truth_table import study as known_trials

        _run("truth", known_trials, output, json, quick=quick, force=force)
        return
    if sensitivity:
        from netboard.services import sensitivity as service

        if workers is not None:
            raise ConfigError("--workers: found with --sensitivity, which takes all cores; leave it out")
        service.main(recordings, output, json, quick=quick, force=force)
        return
    from netboard.benchmarks.analysis import speed_bench as study

    study.main(recordings, workers, output, json, quick=quick, force=force)
