"""``netboard bench recovery`` and ``recording``: recovery and cost of recordings."""

import typer

from netboard.services.bench.options import Force, Json, Output, Quick
from netboard.services.options import examples

app = typer.Typer()


@app.command(epilog=examples("netboard bench recovery --quick", "netboard bench recovery -o results"))
def recovery(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Recovery of recordings that were cut, altered or killed while being written, checked to the bit."""
    from netboard.benchmarks.harness.running import run_named
    from netboard.benchmarks.recording.recovery_bench import study

    verdicts = run_named("recovery", study, output, json, quick=quick, force=force)
    raise typer.Exit(0 if all(verdict.holds for verdict in verdicts) else 1)


@app.command(epilog=examples("netboard bench recording --quick", "netboard bench recording -o results"))
def recording(output: Output = None, quick: Quick = False, force: Force = False, json: Json = None) -> None:
    """Cost of recording: headroom and stalls of the logger, bytes per hour, time to read an hour and a trial."""
    from netboard.benchmarks.harness.running import run_named
    from netboard.benchmarks.recording.bench import study

    run_named("recording", study, output, json, quick=quick, force=force)
