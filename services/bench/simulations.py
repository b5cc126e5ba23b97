"""``netboard bench``: benchmarks that simulate or compute, and need no other process in real time."""

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.bench.options import benchmark
from netboard.services.options import Workers

if TYPE_CHECKING:
    from netboard.benchmarks.harness.running import Options

app = typer.Typer()


@benchmark(app, "netboard bench stability --quick", "netboard bench stability --soak -o results")
def stability(
    options: "Options",
    soak: Annotated[bool, typer.Option("--soak", help="Also step 1e9 times through random scenes.")] = False,
) -> None:
    """Stability of the integration methods: theory, nonlinear runs, stiff scenes and unusual hands."""
    from netboard.benchmarks.stability import bench

    bench.main(options, soak_too=soak)


@benchmark(app, "netboard bench velocity --quick", "netboard bench velocity -o results")
def velocity(options: "Options") -> None:
    """Estimators of stylus velocity: lag, noise, computing time, and the largest stable delay with each."""
    from netboard.benchmarks.harness.running import run
    from netboard.benchmarks.stability.velocity import study

    run("velocity", study, options)


@benchmark(app, "netboard bench physics --quick", "netboard bench physics --peers heyoka -o results")
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
    """Work and precision of the integration methods, compared with other libraries.

    It also measures the cost of a tick and of sampling, and what simple scenes save.
    """
    from netboard.benchmarks.physics import bench

    bench.main(options, peers=[] if no_peers else peers.split(",") if peers else None, model=model, repeats=repeats)


@benchmark(app, "netboard bench coupling --quick", "netboard bench coupling -o results")
def coupling(options: "Options") -> None:
    """Maximum stable delay of the virtual coupling: theory, the simulated service, and what extends it."""
    from netboard.benchmarks.coupling.bench import study
    from netboard.benchmarks.harness.running import run

    run("coupling", study, options)


@benchmark(app, "netboard bench forces --quick", "netboard bench forces -o results")
def forces(options: "Options") -> None:
    """Forces on both hands for one movement under each force condition, as a figure and a table."""
    from netboard.benchmarks.coupling.forces import study
    from netboard.benchmarks.harness.running import run

    run("forces", study, options)


@benchmark(app, "netboard bench participants --quick", "netboard bench participants --studies 200")
def participants(
    options: "Options",
    studies: Annotated[int, typer.Option(min=1, metavar="N", help="Virtual studies of four dyads.")] = 200,
    dyads: Annotated[
        int | None,
        typer.Option(min=4, metavar="N", help="Dyads from which the studies are drawn, a multiple of 4; default: 16."),
    ] = None,
    workers: Workers = None,
) -> None:
    """Compare the simulated participants, and variants that lack one part, with the paper's results."""
    from netboard.benchmarks.harness.running import run
    from netboard.benchmarks.participants.bench import study

    run("participants", partial(study, studies, dyads, workers), options)


@benchmark(
    app,
    "netboard bench analysis --quick",
    "netboard bench analysis recordings/ -o results",
    "netboard bench analysis recordings/ --sensitivity",
    "netboard bench analysis --calibration --quick",
    "netboard bench analysis --truth",
)
def analysis(
    options: "Options",
    recordings: Annotated[
        Path | None, typer.Argument(metavar="[DIR]", help="Recordings of a study; default: rehearse the paper's plan.")
    ] = None,
    sensitivity: Annotated[
        bool,
        typer.Option("--sensitivity", help="Sensitivity of each measure to settings, noise and lost samples, instead."),
    ] = False,
    calibration: Annotated[
        bool, typer.Option("--calibration", help="False positive rate of the tests in simulated studies, instead.")
    ] = False,
    truth: Annotated[
        bool, typer.Option("--truth", help="Measures of trials whose true values are known, instead.")
    ] = False,
    workers: Annotated[
        int | None,
        typer.Option(min=1, metavar="N", help="Processes; default: one per core, or one for a small study."),
    ] = None,
) -> None:
    """Cost of analysing a study: time and memory against its size, with and without the cache."""
    other_options = sensitivity or recordings is not None or workers is not None
    if calibration and (truth or other_options):
        raise ConfigError(
            "--calibration: found with recordings, --sensitivity, --truth or --workers; it simulates its own studies"
        )
    if truth and other_options:
        raise ConfigError("--truth: found with recordings, --sensitivity or --workers; it makes its own trials")
    if sensitivity and workers is not None:
        raise ConfigError("--workers: found with --sensitivity, which uses all cores; leave it out")
    from netboard.benchmarks.harness.running import run

    if calibration:
        from netboard.benchmarks.analysis import calibration as calibration_bench

        run("calibration", calibration_bench.study, options)
    elif truth:
        from netboard.benchmarks.analysis import ground_truth_bench

        run("truth", ground_truth_bench.study, options)
    elif sensitivity:
        from netboard.benchmarks.analysis import sensitivity_bench

        sensitivity_bench.main(recordings, options)
    else:
        from netboard.benchmarks.analysis import speed_bench

        speed_bench.main(recordings, workers, options)
