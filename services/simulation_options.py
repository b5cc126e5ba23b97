"""Options of ``netboard simulate``: the scene, the motion of the hands, the integration, the initial state."""

from pathlib import Path
from typing import Annotated, Literal

import typer

Scene = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="Configuration whose table \\[physics] is the scene; default: the paper's scene."
    ),
]
Hold = Annotated[
    Literal["zoh", "cv", "ca", "hermite"],
    typer.Option(
        help="Motion of a hand between samples. hermite: smooth curve through positions and velocities. As on the live "
        "server: zero-order hold (zoh), constant velocity (cv), constant acceleration (ca)."
    ),
]
Gaps = Annotated[
    Literal["refuse", "hold"],
    typer.Option(
        help="Intervals over three times the usual one. refuse: reject the file. hold: interpolate across them "
        "(hermite), or keep the stylus where it was (zoh, cv, ca)."
    ),
]
Interval = Annotated[
    float,
    typer.Option(
        metavar="S",
        help="Interval between rows of the result, in seconds; steps of all methods but taylor end at rows.",
    ),
]
Method = Annotated[
    str,
    typer.Option(
        metavar="NAME",
        help="Integration method. auto: practically exact, with as many steps as the scene needs (taylor, or dop853 "
        "with --substeps). Otherwise taylor, or one of the server's (euler, rk4, etdrk4, ...), with one step between "
        "samples or rows.",
    ),
]
Substeps = Annotated[int, typer.Option(min=1, metavar="N", help="Integration steps in place of one, at least.")]
Ball = Annotated[Literal["free", "fixed"], typer.Option(help="The ball rolls, or is fixed to the board.")]
Height = Annotated[float, typer.Option("--z0", metavar="M", help="Initial height of the board in m.")]
Velocity = Annotated[float, typer.Option("--vz0", metavar="M/S", help="Initial vertical velocity in m/s.")]
Tilt = Annotated[float, typer.Option("--theta0", metavar="RAD", help="Initial tilt in rad, + = right end up.")]
TiltRate = Annotated[float, typer.Option("--omega0", metavar="RAD/S", help="Initial tilt rate in rad/s.")]
BallPositions = Annotated[
    list[str] | None,
    typer.Option("--p0", metavar="M", help="Initial ball position in m, + = right; several balls as in 0.1,-0.1."),
]
BallVelocities = Annotated[
    list[str] | None,
    typer.Option("--v0", metavar="M/S", help="Initial ball velocity in m/s; several balls as for --p0."),
]
