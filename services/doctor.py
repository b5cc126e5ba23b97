"""``netboard doctor``: whether this computer is fit for a session."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import NetboardError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()


@app.command(epilog=examples("netboard doctor -c rig.toml", "netboard doctor --quick --json report.json"))
def doctor(
    config: ConfigFile = None,
    overrides: Overrides = None,
    quick: Annotated[bool, typer.Option("--quick", help="Take seconds instead of half a minute.")] = False,
    json: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Also write the report there.")] = None,
) -> None:
    """Check whether this computer is fit for a session, and say how to fix each problem."""
    settings = load(config, overrides)
    from netboard.base.terminal.bars import progress_bars
    from netboard.base.terminal.output import plain_console
    from netboard.devices.setup.words import findings_table
    from netboard.nodes.doctor import report as examination
    from netboard.nodes.doctor.loopback import histogram
    from netboard.recording.files.provenance import doctor_report_path

    console = plain_console()
    with progress_bars(console) as progress:
        task = progress.add_task("", total=1.0)
        report = examination.examine(
            settings,
            examination.QUICK if quick else examination.THOROUGH,
            lambda what, done: progress.update(task, description=f"{what:20}", completed=done),
        )
    console.print(findings_table("This computer", report.findings))
    for finding in report.findings:
        for line in histogram(finding):
            console.print(line, highlight=False)
    console.print(report.summary)
    problems = []
    for copy in (None, json) if json else (None,):
        try:
            path = copy or doctor_report_path()
            report.save(path)
        except NetboardError as error:  # the other file is written nevertheless
            problems.append(str(error))
        else:
            console.print(f"report  {path}", soft_wrap=True)
    if problems:
        raise NetboardError("\n".join(problems))
    raise typer.Exit(0 if report.fit else 1)
