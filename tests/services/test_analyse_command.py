"""`netboard analyse`: a complete new folder, tables independent of the workers, or a one-line error."""

import csv
import importlib.util
import json
import tomllib
from collections.abc import Callable, Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path

import pytest
from typer.testing import CliRunner, Result

import sampling
from made_recordings import recorded, two_trials
from netboard.analysis.extraction.store import TABLES
from netboard.analysis.topics import everything
from netboard.analysis.topics.figure import KINDS
from netboard.recording.export import formats
from netboard.services.cli import app
from rehearsed_study import small_study

parquet = pytest.importorskip("pyarrow.parquet")
pytest.importorskip("matplotlib")
pytest.importorskip("jinja2")
pytest.importorskip("statsmodels")
pytestmark = pytest.mark.slow

FIGURES = {draw.__module__: draw for draw in everything.PICTURES}
DRAWN = sampling.some("figures of an analysis", FIGURES, 3)
"""Figures that an analysis draws; drawing all would take most of its time, and each has its own tests."""


@pytest.fixture(scope="module", autouse=True)
def _draw_some_figures() -> Iterator[None]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(everything, "PICTURES", tuple(FIGURES[name] for name in DRAWN))
        yield


@pytest.fixture(scope="module")
def study(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return small_study(tmp_path_factory.mktemp("made"))[0].parent


@pytest.fixture(scope="module")
def default_output(study: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Output folder of an analysis with default options; its cache is the sibling folder `other`."""
    folder = tmp_path_factory.mktemp("default_output")
    result = analyse(study, "-o", folder / "out", "--workers", "1", "--cache", folder / "other")
    assert result.exit_code == 0, result.output
    assert "from the cache" not in result.output
    return folder / "out"


@pytest.fixture(autouse=True)
def _run_in_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")


def analyse(*words: str | Path) -> Result:
    return CliRunner().invoke(app, ["analyse", *map(str, words)])


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw no figures: they take most of the time of a small study."""
    monkeypatch.setattr(everything, "PICTURES", ())


def refused(result: Result) -> str:
    """Return the only line of an error message."""
    assert result.exit_code in (1, 2), result.output
    (line,) = result.stderr.strip().splitlines()
    return line


@pytest.mark.usefixtures("without_figures")
def test_exclusions_are_reported_and_settings_are_saved(study: Path) -> None:
    result = analyse(study, "-o", "out", "--workers", "1", "--set", "exclusions.warm_up=1")
    assert result.exit_code == 0, result.output
    assert "4 recordings" in result.output
    assert "4 trials count" in result.output
    assert "excluded: 4 x the first trial of the block" in result.output
    assert tomllib.loads(Path("out/settings.toml").read_text())["exclusions"]["warm_up"] == 1
    assert list(Path().glob(".out*")) == []


@pytest.mark.usefixtures("without_figures")
def test_unfinished_recordings_are_listed_as_left_out(study: Path) -> None:
    folder = Path("recordings")
    folder.mkdir()
    (folder / "one.mcap").write_bytes(min(study.glob("*.mcap")).read_bytes())
    assert "left out" not in analyse(folder, "-o", "first", "--workers", "1").output
    (folder / "other.mcap.part").touch()
    result = analyse(folder, "-o", "second", "--workers", "1")
    assert "left out: other.mcap.part: is unfinished" in result.output
    assert "other.mcap.part" in Path("second/tables/left_out.csv").read_text()


def test_output_has_tables_figures_settings_provenance_and_report(study: Path, default_output: Path) -> None:
    assert {path.name for path in default_output.iterdir()} == {
        *("tables", "figures", "settings.toml", "provenance.json", "report.html")
    }
    provenance = json.loads((default_output / "provenance.json").read_text())
    assert set(provenance["recordings"]) == {path.stem for path in study.glob("*.mcap")}
    assert all(len(recording["sha256"]) == 64 for recording in provenance["recordings"].values())
    drawn = sorted(path.name for path in (default_output / "figures").iterdir())
    assert {Path(name).suffix for name in drawn} == {".svg", ".pdf", ".png"}
    assert len(drawn) == len({Path(name).stem for name in drawn}) * len(KINDS) == len(DRAWN) * len(KINDS)


def test_every_column_has_a_description_type_and_unit(default_output: Path) -> None:
    tables = default_output / "tables"
    described = json.loads((tables / "dictionary.json").read_text())["tables"]
    for name, table in described.items():
        read = parquet.read_table(tables / f"{name}.parquet")
        assert read.schema.names == list(table["columns"])
        for column, description in table["columns"].items():
            assert description["description"]
            assert read.schema.field(column).metadata[b"unit"].decode() == description["unit"]
            assert description["unit"] or description["type"] == "text"
        if name != "paths":
            with (tables / f"{name}.csv").open(encoding="utf-8", newline="") as file:
                rows = list(csv.reader(file))
            assert rows[0] == read.schema.names
            assert len(rows) == read.num_rows + 1
    assert not (tables / "paths.csv").exists()
    written_as_csv = {
        *("blocks", "trials", "movements", "controls", "people", "answers", "exclusions", "left_out", "results")
    }
    assert set(described) == written_as_csv | {"paths"}


def count_identical_files(one: Path, other: Path) -> int:
    """Require that all files but those of provenance are identical, and return their number."""
    files = [path.relative_to(one) for path in one.rglob("*") if path.is_file()]
    compared = [file for file in files if file.name not in ("provenance.json", "report.html")]
    assert [file for file in compared if (one / file).read_bytes() != (other / file).read_bytes()] == []
    return len(compared)


@pytest.mark.sampled(1, of="same bytes")
def test_output_is_bitwise_identical_for_any_number_of_workers(study: Path, default_output: Path) -> None:
    assert analyse(study, "-o", "two", "--workers", "2").exit_code == 0
    assert (
        count_identical_files(default_output, Path("two"))
        == count_identical_files(Path("two"), default_output)
        > 10 + len(DRAWN) * len(KINDS)
    )


@pytest.mark.usefixtures("without_figures")
@pytest.mark.sampled(1, of="same bytes")
def test_output_is_bitwise_identical_with_the_cache_and_its_use_is_reported(study: Path, default_output: Path) -> None:
    runs = {"anew": ("--no-cache",), "first": (), "kept": (), "measured": ("--set", "exclusions.warm_up=0")}
    for name, words in runs.items():
        result = analyse(study, "-o", name, "--workers", "1", *words)
        assert result.exit_code == 0
        assert ("; all were cached" in result.output) == (name == "kept")
        assert ("; 4 from the cache" in result.output) == (name == "measured")
        assert count_identical_files(Path(name), default_output) > 10
    for cache in (Path("user/netboard/measures"), default_output.with_name("other")):
        assert len(list(cache.glob(f"*{TABLES}"))) == 4


@pytest.mark.usefixtures("without_figures")
def test_compare_paper_adds_a_table_with_the_values_of_the_paper(study: Path, default_output: Path) -> None:
    assert analyse(study, "-o", "out", "--workers", "1", "--compare-paper").exit_code == 0
    comparison = parquet.read_table("out/tables/comparison.parquet").to_pylist()
    assert {5.71, 3.61, 4.33, 3.62} <= {row["reported"] for row in comparison}
    assert "comparison" in json.loads(Path("out/tables/dictionary.json").read_text())["tables"]
    assert not (default_output / "tables" / "comparison.csv").exists()


def test_interrupted_analysis_leaves_final_tables_and_a_report_that_says_so(
    study: Path, default_output: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(folder: Path, *parts: object, **options: object) -> None:
        (folder / "report.html").write_text("half")
        raise KeyboardInterrupt

    monkeypatch.setattr("netboard.analysis.report.folder.write_second_part", interrupt)
    assert analyse(study, "-o", "out", "--workers", "1", "--no-cache").exit_code != 0
    out = Path("out")
    written = {path.relative_to(out) for path in out.rglob("*") if path.is_file()}
    assert {path.name for path in written if len(path.parts) == 1} == {
        "settings.toml",
        "provenance.json",
        "report.html",
    }
    tables = {path for path in written if path.parts[0] == "tables"}
    assert {path.stem for path in tables} >= {"trials", "movements", "paths", "dictionary"}
    assert {path for path in tables if path.stem == "results"} == set()
    assert all((out / path).read_bytes() == (default_output / path).read_bytes() for path in tables)
    report = (out / "report.html").read_text()
    assert "This report is not complete" in report
    assert "This report is not complete" not in (default_output / "report.html").read_text()
    assert report.split("<h1>")[1].split("</h1>")[0] in (default_output / "report.html").read_text()
    assert list(Path().glob(".out*")) == []


def test_analyse_never_overwrites_and_leaves_no_partial_output(study: Path) -> None:
    Path("out").mkdir()
    assert "out: already exists; name another output" in refused(analyse(study, "-o", "out"))
    (broken := Path("broken")).mkdir()
    (broken / "S01.mcap").write_text("nothing")
    assert "S01.mcap: not an MCAP file" in refused(analyse(study, broken, "-o", "new", "--workers", "1"))
    assert not Path("new").exists()
    assert list(Path().glob(".new*")) == []


@pytest.mark.usefixtures("without_figures")
def test_recordings_without_attempts_are_reported(tmp_path: Path) -> None:
    empty = recorded(tmp_path, two_trials()[:900])
    result = analyse(empty, "-o", "out", "--workers", "1", "--no-cache")
    assert result.exit_code == 0, result.output
    assert f"without an attempt: 1 of these, the first is {empty.stem}" in result.output


@pytest.mark.usefixtures("without_figures")
def test_unreadable_recordings_are_skipped_and_listed(study: Path) -> None:
    Path("broken.mcap").write_text("nothing")
    Path("gone.mcap").symlink_to("on a disk that is not mounted")
    Path("torn.mcap").write_bytes(min(study.glob("*.mcap")).read_bytes()[:-1000])
    result = analyse(study, "broken.mcap", "gone.mcap", "torn.mcap", "-o", "out", "--workers", "1", "--skip-unreadable")
    assert result.exit_code == 0, result.output
    listed = parquet.read_table("out/tables/left_out.parquet").to_pylist()
    whys = {"broken.mcap": "not an MCAP file", "gone.mcap": "cannot be read: No such file or directory"}
    torn = "is unfinished or cut short, or has other bytes after its end"
    whys["torn.mcap"] = f"{torn}; netboard recover makes a recording of it"  # in which folder?
    assert listed == [{"file": file, "why": why} for file, why in whys.items()]
    assert all(f"left out: {file}: {why}" in result.output for file, why in whys.items())
    assert json.loads(Path("out/provenance.json").read_text())["left_out"] == listed


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--set", "filters.fst=1"), "[filters] fst: unknown key; did you mean fast"),
        (("--settings", "mine.toml"), "mine.toml: no such file; create it with: netboard analyse --template"),
        (("--cache", "x", "--no-cache"), "--cache and --no-cache: expected one of them"),
        (("--dask", "tcp://127.0.0.1:9", "--workers", "2"), "--workers: found with --dask"),
        (("--set", "exclusions.trials=['S99/1: sneezed']"), "there is no trial 1 in 'S99'"),
    ],
)
def test_wrong_options_print_one_line(study: Path, words: tuple[str, ...], expected: str) -> None:
    more = () if "--workers" in words else ("--workers", "1")
    assert expected in refused(analyse(study, "-o", "out", *words, *more))
    assert not Path("out").exists()


@pytest.mark.usefixtures("without_figures")
def test_template_is_a_file_of_the_default_settings(study: Path, default_output: Path) -> None:
    result = analyse("--template")
    assert result.exit_code == 0
    assert "# cutoff for all force and kinematic data [Hz]" in result.output
    Path("mine.toml").write_text(result.output)
    assert analyse(study, "-o", "one", "--settings", "mine.toml", "--workers", "1").exit_code == 0
    assert Path("one/settings.toml").read_bytes() == (default_output / "settings.toml").read_bytes()


@pytest.mark.parametrize(("name", "extra"), [("statsmodels", "analysis"), ("pyarrow", "analysis")])
def test_missing_library_prints_one_line(study: Path, monkeypatch: pytest.MonkeyPatch, name: str, extra: str) -> None:
    def find_spec_without(hidden: str) -> Callable[[str], ModuleSpec | None]:
        return lambda module: None if module == hidden else importlib.util.find_spec(module)

    monkeypatch.setattr(formats, "find_spec", find_spec_without(name))
    line = refused(analyse(study, "-o", "out"))
    assert f"this needs {name}, which is not installed: pip install 'netboard[{extra}]'" in line
