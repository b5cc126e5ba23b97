"""Benchmarks and studies: ``netboard bench``.

A study and its libraries are imported only when it runs.
"""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services import options
from netboard.services.options import examples

if TYPE_CHECKING:
    from netboard.benchmarks.harness.running import Study

app = typer.Typer(
    name="bench",
    help="Measure netboard on this machine: the physics, the loop from stylus to force, long runs.",
    no_args_is_help=True,
)

Model = Literal["paper", "lagrangian"]

Output = Annotated[
    Path | None, typer.Option("--output", "-o", metavar="DIR", help="Folder for the results; default: a new one here.")
]
Quick = Annotated[bool, typer.Option("--quick", help="Short version, in less than a minute.")]
Force = Annotated[bool, typer.Option("--force", help="Write into an existing folder.")]
Json = Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the results there, as JSON.")]
Transport = Annotated[Literal["tcp", "ipc"], typer.Option(help="Transport of the messages.")]
Curve = Annotated[bool, typer.Option("--curve/--no-curve", help="Encryption with keys.")]
RealTime = Annotated[bool, typer.Option("--realtime/--no-realtime", help="Real-time scheduling.")]
Displays = Annotated[int, typer.Option(min=0, metavar="N", help="Displays per dyad, rendered without a screen.")]


def _run(name: str, study: "Study", output: Path | None, json: Path | None, *, quick: bool, force: bool) -> bool:
    """Run a study; return whether all its claims hold."""
    from netboard.benchmarks.harness.running import run_named

    return all(verdict.holds for verdict in run_named(name, study, output, json, quick=quick, force=force))


@app.command(epilog=examples("netboard bench stability --quick", "netboard bench stability --soak -o results"))
def stability(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    soak: Annotated[bool, typer.Option("--soak", help="Also step 1e9 times through random scenes.")] = False,
) -> None:
    """Stability of the integration methods: theory, nonlinear runs, stiff scenes and unusual hands."""
    from netboard.benchmarks.stability import bench as study

    raise typer.Exit(study.main(output, quick=quick, force=force, soak_too=soak))


@app.command(epilog=examples("netboard bench velocity --quick", "netboard bench velocity -o results"))
def velocity(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Estimators of stylus velocity: lag, noise, computing time, and the largest stable delay with each."""
    from netboard.benchmarks.stability.velocity import study

    _run("velocity", study, output, json, quick=quick, force=force)


@app.command(
    epilog=examples("netboard bench physics --quick", "netboard bench physics --peers heyoka -o results"),
)
def physics(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    peers: Annotated[
        str | None, typer.Option(metavar="NAMES", help="Compare only with these libraries, for example heyoka,mujoco.")
    ] = None,
    no_peers: Annotated[bool, typer.Option("--no-peers", help="Compare with no other library.")] = False,
    model: Annotated[Model | None, typer.Option(help="Only the equations of this model.")] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Repetitions of each timing.")] = None,
) -> None:
    """Work and precision of the integration methods, compared with other libraries.

    It also measures the cost of a tick and of sampling, and what simple scenes save.
    """
    from netboard.benchmarks.physics import bench as study

    names = [] if no_peers else peers.split(",") if peers else None
    raise typer.Exit(study.main(output, quick=quick, force=force, peers=names, model=model, repeats=repeats))


@app.command(
    epilog=examples(
        "netboard bench loop --quick",
        "netboard bench loop --displays 2 --dyads 1,2,4,8,16 --skips",
    )
)
def loop(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    seconds: Annotated[
        float | None, typer.Option(min=0.5, metavar="S", help="Seconds per measurement; default: 60.")
    ] = None,
    transport: Transport = "tcp",
    curve: Curve = False,
    realtime: RealTime = True,
    displays: Displays = 0,
    dyads: Annotated[
        str | None,
        typer.Option(
            metavar="NUMBERS",
            help="Also load a server with these numbers of dyads, as 1,2,4,8.",
        ),
    ] = None,
    skips: Annotated[bool, typer.Option("--skips", help="Also measure the savings in simple scenes.")] = False,
) -> None:
    """Sample-to-force latency in real time, compared with a bare echo and a bare timer: latency, jitter, cost."""
    from netboard.benchmarks.loop import bench as study

    setting = study.Setting(transport, curve, realtime, displays, quick)
    raise typer.Exit(study.loop(setting, seconds, study.read_dyads(dyads), output, json, skips=skips, force=force))


@app.command(
    epilog=examples("netboard bench servo --quick", "netboard bench servo --library /opt/libHD.so -o results"),
)
def servo(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    library: Annotated[
        str,
        typer.Option(metavar="FILE", help="The vendor's library; default: libHD.so or HD.dll of the system."),
    ] = "",
    seconds: Annotated[
        float | None,
        typer.Option(min=0.2, metavar="S", help="Seconds per measurement; default: 30."),
    ] = None,
) -> None:
    """Servo callback of a Touch in Python and in C, compared with an empty callback, with and without a busy thread."""
    from netboard.benchmarks.loop import servo as study

    raise typer.Exit(study.main(library, output, json, seconds, quick=quick, force=force))


@app.command(epilog=examples("netboard bench soak --minutes 30", "netboard bench soak --quick --dyads 2"))
def soak(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    minutes: Annotated[
        float | None, typer.Option(min=0.05, metavar="N", help="Duration in minutes; default: 30.")
    ] = None,
    dyads: Annotated[int, typer.Option(min=1, metavar="N", help="Number of dyads.")] = 1,
    transport: Transport = "tcp",
    curve: Curve = False,
    realtime: RealTime = True,
    displays: Displays = 0,
) -> None:
    """Long run of the whole system: no record is lost, memory stays constant, ticks meet their deadlines."""
    from netboard.benchmarks.loop import bench as study

    setting = study.Setting(transport, curve, realtime, displays, quick)
    raise typer.Exit(study.soak(setting, minutes, dyads, output, json, force=force))


@app.command(epilog=examples("netboard bench coupling --quick", "netboard bench coupling -o results"))
def coupling(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Maximum stable delay of the virtual coupling: theory, the simulated service, and what extends it."""
    from netboard.benchmarks.coupling.bench import study

    _run("coupling", study, output, json, quick=quick, force=force)


@app.command(epilog=examples("netboard bench forces --quick", "netboard bench forces -o results"))
def forces(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Forces on both hands for one movement under each of the six force conditions, as a figure and a table."""
    from netboard.benchmarks.coupling.forces import study

    _run("forces", study, output, json, quick=quick, force=force)


@app.command(epilog=examples("netboard bench participants --quick", "netboard bench participants --studies 200"))
def participants(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    studies: Annotated[int, typer.Option(min=1, metavar="N", help="Virtual studies of four dyads.")] = 200,
    dyads: Annotated[
        int | None,
        typer.Option(min=4, metavar="N", help="Dyads from which the studies are drawn, a multiple of 4; default: 16."),
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, metavar="N", help="Processes; default: one per core.")] = None,
) -> None:
    """Compare the simulated participants, and variants that lack one part, with the paper's results."""
    from netboard.benchmarks.participants.bench import study

    _run("participants", study(studies, dyads, workers), output, json, quick=quick, force=force)


@app.command(epilog=examples("netboard bench fuzz --quick", "netboard bench fuzz --frames 1000000 -o results"))
def fuzz(
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    frames: Annotated[
        int | None,
        typer.Option(min=100, metavar="N", help="Malformed frames per codec and socket; default: a million."),
    ] = None,
) -> None:
    """Malformed frames for the codec and every socket: no crash, no hang, no growth, no changed force."""
    from netboard.benchmarks.faults import fuzz as study

    raise typer.Exit(study.main(output, quick=quick, force=force, frames=frames))


@app.command(
    epilog=examples("netboard bench faults --quick", "netboard bench faults --case server-killed -o results"),
)
def faults(
    output: Output = None,
    quick: Annotated[bool, typer.Option("--quick", help="Short version: fewer faults and shorter waits.")] = False,
    force: Force = False,
    case: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Only this fault; repeat for several.")] = None,
    listing: Annotated[bool, typer.Option("--list", help="List the faults, and stop.")] = False,
) -> None:
    """Faults in real processes (kill, stop, cut the network, fill the disk), and how the system reacts."""
    from netboard.benchmarks.faults import bench as study

    raise typer.Exit(study.list_cases() if listing else study.main(output, quick=quick, force=force, names=case or ()))


@app.command(
    epilog=examples("netboard bench display --quick", "netboard bench display --set display.width=1920"),
)
def display(
    config: options.ConfigFile = None,
    overrides: options.Overrides = None,
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    seconds: Annotated[
        float | None,
        typer.Option(min=1, metavar="S", help="Seconds per measurement; default: 30."),
    ] = None,
) -> None:
    """Latency of a display, from sending a view to painting it: late views, dropped frames, cost."""
    settings = options.load(config, overrides)
    from netboard.benchmarks.loop import display as study

    raise typer.Exit(study.main(settings, output, json, seconds, quick=quick, force=force))


@app.command(epilog=examples("netboard bench recovery --quick", "netboard bench recovery -o results"))
def recovery(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Recovery of recordings that were cut, altered or killed while being written, checked to the bit."""
    from netboard.benchmarks.recording.recovery_bench import study

    raise typer.Exit(0 if _run("recovery", study, output, json, quick=quick, force=force) else 1)


@app.command(epilog=examples("netboard bench recording --quick", "netboard bench recording -o results"))
def recording(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Cost of recording: headroom and stalls of the logger, bytes per hour, time to read an hour and a trial."""
    from netboard.benchmarks.recording.bench import study

    _run("recording", study, output, json, quick=quick, force=force)


@app.command(
    epilog=examples(
        "netboard bench analysis --quick",
        "netboard bench analysis recordings/ -o results",
        "netboard bench analysis recordings/ --sensitivity",
        "netboard bench analysis --calibration --quick",
        "netboard bench analysis --truth",
    )
)
def analysis(
    recordings: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="Recordings of a study; default: rehearse the paper's plan.")
    ] = None,
    sensitivity: Annotated[
        bool,
        typer.Option("--sensitivity", help="Sensitivity of each measure to settings, noise and lost samples, instead."),
    ] = False,
    calibration: Annotated[
        bool,
        typer.Option("--calibration", help="False positive rate of the tests in simulated studies, instead."),
    ] = False,
    truth: Annotated[
        bool, typer.Option("--truth", help="Measures of trials whose true values are known, instead.")
    ] = False,
    output: Output = None,
    quick: Quick = False,
    force: Force = False,
    json: Json = None,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes; default: one per core, or one for a small study."),
    ] = None,
) -> None:
    """Cost of analysing a study: time and memory against its size, with and without the cache."""
    alone = not (sensitivity or recordings is not None or workers is not None)
    if calibration and (truth or not alone):
        raise ConfigError(
            "--calibration: found with recordings, --sensitivity, --truth or --workers; it simulates its own studies"
        )
    if truth and not alone:
        raise ConfigError("--truth: found with recordings, --sensitivity or --workers; it makes its own trials")
    if calibration:
        from netboard.benchmarks.analysis.calibration import study as simulations

        _run("calibration", simulations, output, json, quick=quick, force=force)
        return
    if truth:
        from netboard.benchmarks.analysis.ground_truth_bench import study as ground_truth

        _run("truth", ground_truth, output, json, quick=quick, force=force)
        return
    if sensitivity:
        from netboard.services import sensitivity as service

        if workers is not None:
            raise ConfigError("--workers: found with --sensitivity, which uses all cores; leave it out")
        service.main(recordings, output, json, quick=quick, force=force)
        return
    from netboard.benchmarks.analysis import speed_bench as study

    study.main(recordings, workers, output, json, quick=quick, force=force)
