"""The commands of the analysis: their options, but not their implementation."""

from pathlib import Path
from typing import Annotated

import typer

from netboard.base.errors import ConfigError
from netboard.services.configuration import Overrides, load_readings
from netboard.services.recordings import RecordingFile
from netboard.services.wording import examples

SettingsFile = Annotated[
    Path | None,
    typer.Option(
        "--settings", metavar="FILE", help="Analysis settings: definitions of measures and exclusion rules (TOML)."
    ),
]


def _print_template(wanted: bool) -> None:
    """Print the default settings of an analysis and stop, if asked."""
    if wanted:
        from netboard.analysis.extraction.settings import template

        typer.echo(template(), nl=False)
        raise typer.Exit(0)


def analyse(
    recordings: Annotated[list[Path], typer.Argument(metavar="RECORDING", help="Recordings, or folders of them.")],
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="FOLDER",
            help="New folder for the export. Default: named after the first recording.",
        ),
    ] = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    template: Annotated[
        bool,
        typer.Option(
            "--template", callback=_print_template, is_eager=True, help="Print all settings, with comments, and stop."
        ),
    ] = False,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Worker processes. Default: one per core.")
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Use a Dask cluster instead, such as tcp://10.0.0.5:8786."),
    ] = None,
    cache: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Cache folder. Default: a folder in ~/.cache (XDG_CACHE_HOME)."),
    ] = None,
    no_cache: Annotated[bool, typer.Option("--no-cache", help="Neither read nor write the cache.")] = False,
    compare_paper: Annotated[
        bool, typer.Option("--compare-paper", help="Print the results beside the values reported in the paper.")
    ] = False,
    skip_unreadable: Annotated[
        bool, typer.Option("--skip-unreadable", help="Skip recordings that cannot be analysed, and list them.")
    ] = False,
) -> None:
    r"""Analyse a study: tables of all trials, results, figures and a report, in a new folder.

    This needs extra libraries: pip install 'netboard\[analysis]', and for --dask also 'netboard\[dask]'.
    """
    from netboard.services import analyse as service

    if cache is not None and no_cache:
        raise ConfigError("--cache and --no-cache: expected one of them")
    wishes = service.Wishes(workers, dask, cache, not no_cache, skip_unreadable, compare_paper)
    raise typer.Exit(service.main(recordings, output, service.Asked(settings, tuple(overrides or ())), wishes))


def explain(
    recording: RecordingFile,
    trial: Annotated[int, typer.Option(min=1, help="Number of the trial in its block.")],
    attempt: Annotated[int | None, typer.Option(min=1, help="Number of the attempt. Default: the last one.")] = None,
    settings: SettingsFile = None,
    overrides: Overrides = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Figure file (.png, .svg or .pdf). Default: named after the trial."
        ),
    ] = None,
) -> None:
    """Plot how each measure of one trial is computed: its traces, annotated with what each measure detects."""
    from netboard.services import explain as service

    readings = load_readings(settings, overrides or ())
    raise typer.Exit(service.main(recording, trial, attempt, readings, output))


def add_to(app: typer.Typer) -> None:
    """Add these commands."""
    app.command(
        epilog=examples(
            "netboard analyse recordings/ -o study",
            "netboard analyse recordings/ --set filters.fast=10 --set exclusions.warm_up=5",
            "netboard analyse --template > analysis.toml",
            "netboard analyse recordings/ --settings analysis.toml --dask tcp://10.0.0.5:8786",
        )
    )(analyse)
    app.command(
        epilog=examples(
            "netboard explain S01.mcap --trial 12",
            "netboard explain S01.mcap --trial 12 --set peaks.window=whole -o trial12.svg",
        )
    )(explain)
