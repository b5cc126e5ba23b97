"""``netboard bench``: benchmarks of real processes, which run in real time on this machine."""

from typing import TYPE_CHECKING, Annotated, Literal

import typer

from netboard.services.bench.options import benchmark
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Offscreen, Overrides

if TYPE_CHECKING:
    from netboard.benchmarks.harness.running import Options

app = typer.Typer()

Transport = Annotated[Literal["tcp", "ipc"], typer.Option(help="Transport of the messages.")]
Curve = Annotated[bool, typer.Option("--curve/--no-curve", help="Encryption with keys.")]
RealTime = Annotated[bool, typer.Option("--realtime/--no-realtime", help="Real-time scheduling.")]
Displays = Annotated[int, typer.Option(min=0, metavar="N", help="Displays per dyad, rendered without a screen.")]


@benchmark(app, "netboard bench loop --quick", "netboard bench loop --device touch", "netboard bench loop --displays 2")
def loop(
    options: "Options",
    seconds: Annotated[
        float | None, typer.Option(min=0.5, metavar="S", help="Seconds per measurement; default: 60.")
    ] = None,
    transport: Transport = "tcp",
    curve: Curve = False,
    realtime: RealTime = True,
    displays: Displays = 0,
    device: Annotated[
        Literal["virtual", "touch"],
        typer.Option(help="Device of the agents; touch: a Touch with a stand-in for the vendor's library."),
    ] = "virtual",
) -> None:
    """Sample-to-force latency in real time, compared with a bare echo and a bare timer: latency, jitter, cost."""
    from netboard.benchmarks.loop import bench

    setting = bench.Setting(transport, curve, realtime, displays, device)
    bench.loop(setting, seconds, options)


@benchmark(app, "netboard bench servo --quick", "netboard bench servo --library /opt/libHD.so -o results")
def servo(
    options: "Options",
    library: Annotated[
        str, typer.Option(metavar="FILE", help="The vendor's library; default: libHD.so or HD.dll of the system.")
    ] = "",
    seconds: Annotated[
        float | None, typer.Option(min=0.2, metavar="S", help="Seconds per measurement; default: 30.")
    ] = None,
) -> None:
    """Servo callback of a Touch in Python and in C, compared with an empty callback, with and without a busy thread."""
    from netboard.benchmarks.loop.servo import main

    main(library, seconds, options)


@benchmark(app, "netboard bench soak --minutes 30", "netboard bench soak --quick --dyads 2")
def soak(
    options: "Options",
    minutes: Annotated[
        float | None, typer.Option(min=0.05, metavar="N", help="Duration in minutes; default: 30.")
    ] = None,
    dyads: Annotated[int, typer.Option(min=1, metavar="N", help="Number of dyads.")] = 1,
    transport: Transport = "tcp",
    curve: Curve = False,
    realtime: RealTime = True,
    displays: Displays = 0,
) -> int:
    """Long run of the whole system: no record is lost, memory stays constant, ticks meet their deadlines."""
    from netboard.benchmarks.loop import bench

    return bench.soak(bench.Setting(transport, curve, realtime, displays), minutes, dyads, options)


@benchmark(app, "netboard bench display --quick", "netboard bench display --set display.width=1920")
def display(
    options: "Options",
    config: ConfigFile = None,
    overrides: Overrides = None,
    seconds: Annotated[
        float | None, typer.Option(min=1, metavar="S", help="Seconds per measurement; default: 30.")
    ] = None,
    offscreen: Offscreen = False,
) -> None:
    """Latency of a display, from sending a view to painting it: late views, dropped frames, cost."""
    settings = load(config, overrides)
    from netboard.base.process.display_server import choose_screen

    choose_screen(offscreen)
    from netboard.benchmarks.loop.display import main

    main(settings, seconds, options)


@benchmark(app, "netboard bench triggers --quick", "netboard bench triggers --seconds 600 -o results")
def triggers(
    options: "Options",
    seconds: Annotated[float | None, typer.Option(min=1, metavar="S", help="Seconds of pulses; default: 120.")] = None,
) -> None:
    """Latency of TTL triggers in a session, from the tick of an event to the pulse of a stand-in for a trigger box."""
    from netboard.benchmarks.loop.triggers import main

    main(seconds, options)


@benchmark(app, "netboard bench recording --quick", "netboard bench recording -o results")
def recording(options: "Options") -> None:
    """Cost of recording: headroom and stalls of the logger, bytes per hour, time to read an hour and a trial."""
    from netboard.benchmarks.harness.running import run
    from netboard.benchmarks.recording.bench import study

    run("recording", study, options)


@benchmark(app, "netboard bench startup --quick", "netboard bench startup -o results")
def startup(options: "Options") -> None:
    """Time until commands and processes are ready, without and with cached kernels, beside bare imports."""
    from netboard.benchmarks.loop.startup import main

    main(options)
