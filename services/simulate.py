"""``netboard simulate``: a scene, moved by recorded hands, offline."""

from typing import Annotated

import typer

from netboard.services import simulation_options as simulation
from netboard.services.options import Model, Overrides, changes_of, examples
from netboard.services.values import numbers_of

app = typer.Typer()


Inputs = Annotated[
    list[str],
    typer.Option(
        "--input",
        "-i",
        metavar="FILE",
        help="Recorded hands (.csv or .parquet) with the columns t, z_left, v_left, z_right, v_right in s, m and "
        "m/s, at any rate; or a folder or a pattern. Repeat for several.",
    ),
]
Output = Annotated[
    str,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE|FOLDER",
        help="Result (.csv or .parquet) with the columns t, z, vz, theta, omega, p, vp, f_left, f_right in SI "
        "units. The forces are those of the hands on the board, + = up; the hands feel the opposite. For several "
        "inputs, a folder, or a name in which {} stands for the name of the input.",
    ),
]


@app.command(
    epilog=examples(
        "netboard simulate --input stylus.csv --output out.csv",
        "netboard simulate --input stylus.csv --output out.parquet --model lagrangian --set physics.k_h=300 --p0 -0.15",
        "netboard simulate --input stylus.csv --output live.csv --hold ca --method rk4 --dt 0.001",
        "netboard simulate --input hands/ --output results/",
        "netboard simulate --input 'hands/*.csv' --output 'results/{}.parquet' --scene rig.toml --gaps hold",
    )
)
def simulate(
    inputs: Inputs,
    output: Output,
    more: Annotated[
        list[str] | None, typer.Argument(metavar="FILE", help="More inputs, so that --input hands/*.csv works.")
    ] = None,
    scene: simulation.Scene = None,
    overrides: Overrides = None,
    model: Model = None,
    hold: simulation.Hold = "hermite",
    gaps: simulation.Gaps = "refuse",
    dt: simulation.Interval = 0.001,
    method: simulation.Method = "auto",
    substeps: simulation.Substeps = 1,
    ball: simulation.Ball = "free",
    z0: simulation.Height = 0.0,
    vz0: simulation.Velocity = 0.0,
    theta0: simulation.Tilt = 0.0,
    omega0: simulation.TiltRate = 0.0,
    p0: simulation.BallPositions = None,
    v0: simulation.BallVelocities = None,
    energy: Annotated[
        bool, typer.Option("--energy", help="Add columns with energies (E_...) and work since the start (W_...) in J.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing results.")] = False,
) -> None:
    """Simulate a scene with recorded hands, offline and as exactly as the samples allow."""
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.output import plain_console
    from netboard.services.hand_simulation import SimulationOptions, load_scene, simulate_files

    chosen = SimulationOptions(
        hold=hold,
        gaps=gaps,
        method=method,
        dt=dt,
        substeps=substeps,
        ball=ball,
        board0=(z0, vz0, theta0, omega0),
        p0=numbers_of("--p0", p0 or ()),
        v0=numbers_of("--v0", v0 or ()),
        energy=energy,
    )
    settings = load_scene(scene, changes_of(overrides, model))
    console = plain_console()
    with interrupted_by_stop_signals():
        for line in simulate_files([*inputs, *(more or ())], output, settings, chosen, force):
            console.print(line)
