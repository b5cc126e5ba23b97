"""``netboard bench loop``, ``servo`` and ``soak``: the loop from stylus to force."""

from typing import Annotated, Literal

import typer

from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.options import examples

app = typer.Typer()

Transport = Annotated[Literal["tcp", "ipc"], typer.Option(help="Transport of the messages.")]
Curve = Annotated[bool, typer.Option("--curve/--no-curve", help="Encryption with keys.")]
RealTime = Annotated[bool, typer.Option("--realtime/--no-realtime", help="Real-time scheduling.")]
Displays = Annotated[int, typer.Option(min=0, metavar="N", help="Displays per dyad, rendered without a screen.")]


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
