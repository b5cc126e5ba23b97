"""``netboard import``: tables as recordings, given one by one or listed in a manifest."""

import time
from pathlib import Path
from typing import Annotated, Literal

import typer

from netboard.base.errors import ConfigError
from netboard.services.loading import load
from netboard.services.options import ConfigFile, Overrides, examples

app = typer.Typer()


@app.command(
    "import",
    epilog=examples(
        "netboard import study/ticks/S01.parquet",
        "netboard import hands.csv --simulate -c rig.toml",
        "netboard import --manifest study.toml -o recordings/",
        "netboard import theirs.csv --map time=t --unit time=ms --unit left_z=mm --unit right_z=mm",
    ),
)
def import_(
    tables: Annotated[
        list[Path] | None, typer.Argument(metavar="[TABLE]...", help="Tables (.csv or .parquet).")
    ] = None,
    manifest: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Import the tables of a study that this TOML file lists.")
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, metavar="N", help="Processes for --manifest; default: one per core.")
    ] = None,
    config: ConfigFile = None,
    settings: Overrides = None,
    names: Annotated[
        list[str] | None,
        typer.Option("--map", metavar="COLUMN=THEIRS", help="Name of a column in the table; repeat for several."),
    ] = None,
    units: Annotated[
        list[str] | None,
        typer.Option("--unit", metavar="COLUMN=UNIT", help="Unit of a column in the table: mm; -mm inverts the axis."),
    ] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Compute board, ball and trials from the hands, as the server does.")
    ] = False,
    interpolation: Annotated[
        Literal["cubic", "linear"], typer.Option(help="Interpolation of positions between samples.")
    ] = "cubic",
    gap: Annotated[
        float, typer.Option(min=0.002, help="A longer interval between samples is a gap, in seconds.")
    ] = 0.1,
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FOLDER", help="Folder for the recordings.")] = Path(
        "recordings"
    ),
) -> None:
    """Import tables as recordings: measurements from other systems, or an exported table of ticks."""
    given = {"--config": config, "--set": settings, "--map": names, "--unit": units, "--simulate": simulate}
    others = [option for option, value in given.items() if value]
    if bool(tables) == (manifest is not None):
        raise ConfigError("import: expected either TABLE... or --manifest")
    if manifest is not None and others:
        raise ConfigError(f"--manifest: found with {', '.join(others)}; set these in {manifest} instead")
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.terminal.bars import telling
    from netboard.recording.importing.table_import import ImportOptions, import_table, in_words

    if manifest is not None:
        raise typer.Exit(import_study(manifest, output, workers))
    rig = load(config, settings)
    chosen = ImportOptions(tuple(names or ()), tuple(units or ()), simulate, interpolation, gap)
    for table in tables or ():
        with interrupted_by_stop_signals(), telling() as tell:
            found = import_table(table, output, rig, chosen, time.time_ns(), tell)
        typer.echo("\n".join(in_words([found])))


def import_study(manifest: Path, folder: Path, workers: int | None) -> int:
    """Import the tables that a manifest lists, several at a time."""
    from netboard.base.process.stopping import interrupted_by_stop_signals
    from netboard.base.process.workers import cores
    from netboard.base.terminal.bars import telling
    from netboard.recording.importing.study_import import examine, run
    from netboard.recording.importing.table_import import in_words

    began = time.perf_counter()
    with interrupted_by_stop_signals(), telling() as tell:
        plan = examine(manifest, folder, tell)
        done, failed = run(plan, folder, workers or cores(), tell) if plan.jobs else ([], [])
    total = f"{len(done)} imported, {len(plan.done)} already there, {len(failed)} failed"
    typer.echo("\n".join((*in_words(done), f"{total}; {time.perf_counter() - began:.1f} s")))
    for line in failed:
        typer.echo(line, err=True)
    return 1 if failed else 0
