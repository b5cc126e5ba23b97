"""The command that simulates a scene from recorded hands: its options, but not its implementation."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.configuration import Overrides
from netboard.services.wording import examples

Inputs = Annotated[
    list[str],
    typer.Option(
        "--input",
        "-i",
        metavar="FILE",
        help="Hands: .csv or .parquet with the columns t, z_left, v_left, z_right, v_right (s, m, m/s), at any "
        "rate. A folder or a pattern stands for all its files; may be given again.",
    ),
]
Output = Annotated[
    str,
    typer.Option(
        "--output",
        "-o",
        metavar="FILE|FOLDER",
        help="The result: .csv or .parquet with the columns t, z, vz, theta, omega, p, vp, f_left, f_right (SI; "
        "the forces are those of the hands on the board, + = up: the hands feel the opposite). For several inputs "
        "a folder, or a name with {} for that of the input.",
    ),
]
More = Annotated[list[str] | None, typer.Argument(metavar="FILE", help="More input files.")]
Scene = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Configuration file; only its table \\[physics] is used. Default: the paper's scene."
    ),
]
Model = Annotated[Literal["paper", "lagrangian"] | None, typer.Option(help="Short for --set physics.model=...")]
Hold = Annotated[
    Literal["zoh", "cv", "ca", "hermite"],
    typer.Option(
        help="Hand motion between samples: hermite (cubic through heights and velocities), or the "
        "extrapolation of a live server: zoh (zero-order hold), cv (constant velocity), ca (constant "
        "acceleration)."
    ),
]
Gaps = Annotated[
    Literal["refuse", "hold"],
    typer.Option(
        help="Gaps longer than 3 sample intervals: refuse the file, or hold, which interpolates across the gap "
        "(hermite) or keeps the last position (zoh, cv, ca)."
    ),
]
RowTime = Annotated[
    float, typer.Option(metavar="S", help="Interval between rows of the result, and longest integration step (s).")
]
Method = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Integration method. auto: error-controlled, close to exact; or a method of the server (euler, "
        "rk4, etdrk4 ...), one step from each sample or row to the next.",
    ),
]
Substeps = Annotated[int, typer.Option(min=1, metavar="N", help="Smallest number of substeps of each step.")]
Ball = Annotated[Literal["free", "fixed"], typer.Option(help="Whether the ball rolls or is fixed.")]
Height = Annotated[float, typer.Option("--z0", metavar="M", help="Height of the board at the first sample (m).")]
HeightRate = Annotated[
    float, typer.Option("--vz0", metavar="M/S", help="Velocity of the board at the first sample (m/s).")
]
Tilt = Annotated[
    float,
    typer.Option("--theta0", metavar="RAD", help="Tilt of the board at the first sample, + = right end up (rad)."),
]
TiltRate = Annotated[
    float, typer.Option("--omega0", metavar="RAD/S", help="Angular velocity of the board at the first sample (rad/s).")
]
BallPlace = Annotated[
    list[str] | None,
    typer.Option(
        "--p0", metavar="M", help="Ball position along the board, + = right (m); one value per ball, as 0.1,-0.1."
    ),
]
BallRate = Annotated[
    list[str] | None,
    typer.Option("--v0", metavar="M/S", help="Ball velocity along the board (m/s); one value per ball."),
]
Energy = Annotated[
    bool, typer.Option("--energy", help="Add columns: energies (E_...) and work since the first row (W_...), in J.")
]
Force = Annotated[bool, typer.Option("--force", help="Overwrite existing results.")]


def simulate(
    inputs: Inputs,
    output: Output,
    more: More = None,
    scene: Scene = None,
    overrides: Overrides = None,
    model: Model = None,
    hold: Hold = "hermite",
    gaps: Gaps = "refuse",
    dt: RowTime = 0.001,
    method: Method = "auto",
    substeps: Substeps = 1,
    ball: Ball = "free",
    z0: Height = 0.0,
    vz0: HeightRate = 0.0,
    theta0: Tilt = 0.0,
    omega0: TiltRate = 0.0,
    p0: BallPlace = None,
    v0: BallRate = None,
    energy: Energy = False,
    force: Force = False,
) -> None:
    """Simulate a scene with the hands in a file, offline and as exactly as the samples allow."""
    if energy and hold != "hermite":
        raise ConfigError(f"--energy: found --hold {hold}, expected hermite: otherwise the hands jump from row to row")
    from netboard.services import simulate as service

    settings = service.load_scene(scene, [*(overrides or ()), *([f"physics.model={model}"] if model else ())])
    wishes = service.Wishes(
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
    raise typer.Exit(service.main([*inputs, *(more or ())], output, settings, wishes, force=force))


def numbers(option: str, words: list[str] | None) -> tuple[float, ...]:
    """Read the numbers of an option that may be repeated, or separated by commas."""
    try:
        return tuple(float(word) for given in words or () for word in given.split(","))
    except ValueError:
        raise ConfigError(f"{option}: found {' '.join(words or ())}, expected numbers, with commas between") from None


def add_to(app: typer.Typer) -> None:
    """Add this command."""
    app.command(
        epilog=examples(
            "netboard simulate --input stylus.csv --output out.csv",
            "netboard simulate --input stylus.csv --output out.parquet --model lagrangian --set physics.k_h=300 "
            "--p0 -0.15",
            "netboard simulate --input stylus.csv --output live.csv --hold ca --method rk4 --dt 0.001",
            "netboard simulate --input hands/ --output results/",
            "netboard simulate --input 'hands/*.csv' --output 'results/{}.parquet' --scene rig.toml --gaps hold",
        )
    )(simulate)
