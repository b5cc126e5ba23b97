"""``netboard simulate``: a scene, moved by recorded hands, offline."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.options import Model, Overrides, changes_of, examples

app = typer.Typer()


@app.command(
    epilog=examples(
        "netboard simulate --input stylus.csv --output out.csv",
        "netboard simulate --input stylus.csv --output out.parquet --model lagrangian --set physics.k_h=300 --p0 -0.15",
        "netboard simulate --input stylus.csv --output live.csv --hold ca --method rk4 --dt 0.001",
        "netboard simulate --input hands/ --output results/",
        "netboard simulate --input 'hands/*.csv' --output 'results/{}.parquet' --scene rig.toml --gaps hold",
    ),
)
def simulate(
    inputs: Annotated[
        list[str],
        typer.Option(
            "--input",
            "-i",
            metavar="FILE",
            help="Recorded hands (.csv or .parquet) with the columns t, z_left, v_left, z_right, v_right in s, m and "
            "m/s, at any rate; or a folder or a pattern. Repeat for several.",
        ),
    ],
    output: Annotated[
        str,
        typer.Option(
            "--output",
            "-o",
            metavar="FILE|FOLDER",
            help="Result (.csv or .parquet) with the columns t, z, vz, theta, omega, p, vp, f_left, f_right in SI "
            "units. The forces are those of the hands on the board, + = up; the hands feel the opposite. For several "
            "inputs, a folder, or a name in which {} stands for the name of the input.",
        ),
    ],
    more: Annotated[
        list[str] | None, typer.Argument(metavar="FILE", help="More inputs, so that --input hands/*.csv works.")
    ] = None,
    scene: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Configuration whose table \\[physics] is the scene; default: the paper's scene."
        ),
    ] = None,
    overrides: Overrides = None,
    model: Model = None,
    hold: Annotated[
        Literal["zoh", "cv", "ca", "hermite"],
        typer.Option(
            help="Motion of a hand between samples. hermite: smooth curve through positions and velocities. As on the "
            "live server: zero-order hold (zoh), constant velocity (cv), constant acceleration (ca)."
        ),
    ] = "hermite",
    gaps: Annotated[
        Literal["refuse", "hold"],
        typer.Option(
            help="Intervals over three times the usual one. refuse: reject the file. hold: interpolate across them "
            "(hermite), or keep the stylus where it was (zoh, cv, ca)."
        ),
    ] = "refuse",
    dt: Annotated[
        float, typer.Option(metavar="S", help="Interval between rows of the result, and longest step, in seconds.")
    ] = 0.001,
    method: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Integration method. auto: practically exact, with as many steps as the scene needs. Otherwise one of "
            "the server's (euler, rk4, etdrk4, ...), with one step between samples or rows.",
        ),
    ] = "auto",
    substeps: Annotated[int, typer.Option(min=1, metavar="N", help="Smallest number of steps in place of one.")] = 1,
    ball: Annotated[Literal["free", "fixed"], typer.Option(help="The ball rolls, or is fixed to the board.")] = "free",
    z0: Annotated[float, typer.Option("--z0", metavar="M", help="Initial height of the board in m.")] = 0.0,
    vz0: Annotated[float, typer.Option("--vz0", metavar="M/S", help="Initial vertical velocity in m/s.")] = 0.0,
    theta0: Annotated[
        float, typer.Option("--theta0", metavar="RAD", help="Initial tilt in rad, + = right end up.")
    ] = 0.0,
    omega0: Annotated[float, typer.Option("--omega0", metavar="RAD/S", help="Initial tilt rate in rad/s.")] = 0.0,
    p0: Annotated[
        list[str] | None,
        typer.Option("--p0", metavar="M", help="Initial ball position in m, + = right; several balls as in 0.1,-0.1."),
    ] = None,
    v0: Annotated[
        list[str] | None,
        typer.Option("--v0", metavar="M/S", help="Initial ball velocity in m/s; several balls as for --p0."),
    ] = None,
    energy: Annotated[
        bool, typer.Option("--energy", help="Add columns with energies (E_...) and work since the start (W_...) in J.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite existing results.")] = False,
) -> None:
    """Simulate a scene with recorded hands, offline and as exactly as the samples allow."""
    from rich.console import Console

    from netboard.recording.importing.hand_simulation import SimulationOptions, load_scene, simulate_files

    chosen = SimulationOptions(
        hold=hold,
        gaps=gaps,
        method=method,
        dt=dt,
        substeps=substeps,
        ball=ball,
        board0=(z0, vz0, theta0, omega0),
        p0=numbers("--p0", p0),
        v0=numbers("--v0", v0),
        energy=energy,
    )
    settings = load_scene(scene, changes_of(overrides, model))
    console = Console(highlight=False)
    for line in simulate_files([*inputs, *(more or ())], output, settings, chosen, force):
        console.print(line)


def numbers(option: str, words: list[str] | None) -> tuple[float, ...]:
    """Read the numbers of an option that may be repeated, or separated by commas."""
    try:
        return tuple(float(word) for given in words or () for word in given.split(","))
    except ValueError:
        raise ConfigError(f"{option}: found {' '.join(words or ())}, expected numbers separated by commas") from None
