"""``netboard bench``: benchmarks that simulate or compute, and need no other process in real time."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.services.bench.options import benchmark

if TYPE_CHECKING:
    from netboard.benchmarks.harness.running import Options

app = typer.Typer()


@benchmark(app, "netboard bench stability --quick", "netboard bench stability -o results")
def stability(options: "Options") -> None:
    """Stability of the integration methods: theory, nonlinear runs and stiff scenes."""
    from netboard.benchmarks.stability import bench

    bench.main(options)


@benchmark(app, "netboard bench physics --quick", "netboard bench physics -o results")
def physics(
    options: "Options",
    model: Annotated[
        Literal["paper", "lagrangian"] | None, typer.Option(help="Only the equations of this model.")
    ] = None,
    repeats: Annotated[int | None, typer.Option(min=1, help="Repetitions of each timing.")] = None,
) -> None:
    """Cost of a tick of the server and of its parts, compared with a lower bound on this machine."""
    from netboard.benchmarks.physics.bench import main

    main(model, repeats, options)


@benchmark(app, "netboard bench environments --quick", "netboard bench environments -o results")
def environments(options: "Options") -> None:
    """Speed of the environments for reinforcement learning, and how far those at reduced fidelity differ."""
    from netboard.benchmarks.environments.bench import main

    main(options)
