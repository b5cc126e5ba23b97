"""``netboard analyse``: a study as tables, results, figures and a report."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load_readings, settings_text
from netboard.services.options import Dask, NewFolder, Overrides, Recordings, SettingsFile, Workers, examples

app = typer.Typer()


def _print_template(wanted: bool) -> None:
    """Print the default settings of an analysis and stop, if asked."""
    if wanted:
        from netboard.analysis.extraction.settings import template

        typer.echo(template(), nl=False)
        raise typer.Exit(0)


@app.command(
    epilog=examples(
        "netboard analyse recordings/ -o study",
        "netboard analyse recordings/ --set filters.fast=10 --set exclusions.warm_up=5",
        "netboard analyse --template > analysis.toml",
        "netboard analyse recordings/ --settings analysis.toml --dask tcp://10.0.0.5:8786",
    )
)
def analyse(
    recordings: Recordings,
    output: NewFolder = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    template: Annotated[
        bool,
        typer.Option(
            "--template", callback=_print_template, is_eager=True, help="Print all settings with comments, and stop."
        ),
    ] = False,
    workers: Workers = None,
    dask: Dask = None,
    cache: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Cache folder; default: in ~/.cache (XDG_CACHE_HOME).")
    ] = None,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="Neither use nor fill the cache.")] = False,
    compare_paper: Annotated[
        bool, typer.Option("--compare-paper", help="Compare the results with those reported in the paper.")
    ] = False,
    skip_unreadable: Annotated[
        bool, typer.Option("--skip-unreadable", help="Leave out recordings that cannot be read, and list them.")
    ] = False,
) -> None:
    r"""Analyse a study: tables of all trials, results, figures and a report, in a new folder.

    Needs additional libraries: pip install 'netboard\[analysis]', and for --dask also 'netboard\[dask]'.
    """
    from netboard.analysis.report import analysing
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.output import plain_console

    if cache is not None and no_cache:
        raise ConfigError("--cache and --no-cache: expected one of them")
    chosen = analysing.AnalysisOptions(workers, dask, cache, not no_cache, skip_unreadable, compare_paper)
    text = settings_text(settings)  # once: the cached analysis is that of this text
    read = lambda: load_readings(settings, overrides, text)  # noqa: E731
    console = plain_console(soft_wrap=True)
    with interrupted_by_stop_signals():
        for line in analysing.analyse(recordings, output, text, overrides or (), chosen, read):
            console.print(line)
