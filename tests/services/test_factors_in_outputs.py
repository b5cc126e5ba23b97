"""A study with factors between dyads, between blocks and within blocks: each factor is in every output."""

import csv
import json
import shutil
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from rich.console import Console
from typer.testing import CliRunner

from netboard.analysis.extraction.recordings import measure
from netboard.analysis.extraction.settings import Readings, parse
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.report.design import design
from netboard.analysis.report.tables import write_tables
from netboard.analysis.topics.contrasts import comparisons
from netboard.analysis.topics.everything import results_of
from netboard.analysis.topics.groups import bounded, conditions
from netboard.analysis.topics.models import fits
from netboard.analysis.topics.quality import quality
from netboard.base.config import Config
from netboard.nodes.rehearsal.jobs import jobs_of, rehearse_all
from netboard.recording.export.formats import export
from netboard.recording.export.runs import runs_of
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.catalogue import entry_of
from netboard.recording.replay.text import provenance_table
from netboard.services.cli import app
from netboard.task.plans.plan import blocks_of, shortened
from netboard.task.studies.study import parse_study

FILE = Path(__file__).parents[1] / "data" / "studies" / "mass_by_force.toml"
AGE = '\n[factors.age]\norder = "between"\nunit = "y"\nlevels.young.value = 22.0\nlevels.old.value = 71.0\n'
TRIALS = 2
COLUMNS = {
    "factor_mass": {"light", "heavy"},
    "factor_felt": {"board", "partner"},
    "factor_gain": {"weak", "strong"},
    "factor_age": {"young", "old"},
}
VALUES = {
    "factor_mass_value": ("kg", {0.02, 0.05}),
    "factor_gain_value": ("1", {0.5, 1.0}),
    "factor_age_value": ("y", {22.0, 71.0}),
}

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def recordings(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, ...]:
    folder = tmp_path_factory.mktemp("recordings")
    study = parse_study(FILE.read_text(encoding="utf-8") + AGE)
    for dyad in (1, 2):
        blocks = list(shortened(blocks_of(Config(), study, 1, dyad), None, TRIALS))
        rehearse_all(jobs_of(blocks, 1, dyad, folder), 1)
    return tuple(sorted(folder.glob("*.mcap")))


@pytest.fixture(scope="module")
def study(recordings: tuple[Path, ...]) -> StudyData:
    return study_of([measure(run, Readings()) for run in runs_of(recordings)], Readings())


@pytest.fixture(scope="module")
def tables(study: StudyData, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("analysis") / "tables"
    write_tables(folder, study, results_of(study, (quality, comparisons, fits)), [])
    return folder


def rows_of(path: Path, delimiter: str = ",") -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file, delimiter=delimiter))


def check_columns(rows: list[dict[str, str]], names: Mapping[str, set[str]] = COLUMNS, missing: str = "") -> None:
    """Require that the rows have every level of every factor with its value, and no other level."""
    for name, levels in names.items():
        assert {row[name] for row in rows} - {missing} == levels
        value = f"{name}_value"
        if value in VALUES and value in rows[0]:
            assert {float(row[value]) for row in rows if row[name] != missing} == VALUES[value][1]


def printed(item: Any) -> str:
    console = Console(width=200)
    with console.capture() as captured:
        console.print(item)
    return captured.get()


# --- plan, info, sessions ----------------------------------------------------------------------------------------


def test_plan_check_prints_factors_and_roles(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["plan", "check", str(FILE), "--dyads", "2"])
    assert result.exit_code == 0
    console_text = result.output
    assert "4 blocks, 32 trials, 1 practice block with 2 trials" in console_text
    assert "factor mass: light (0.02 kg), heavy (0.05 kg); numeric, between blocks" in console_text
    assert "factor gain: weak (0.5), strong (1); numeric, within blocks" in console_text


def test_info_and_sessions_print_role_and_factors(recordings: tuple[Path, ...]) -> None:
    practice, first = recordings[:2]
    with Recording(first) as recording:
        console_text = printed(provenance_table(recording))
    for words in ("test, kind duo", "light (0.02 kg), numeric", "board, categorical", "young (22 y), numeric"):
        assert words in console_text
    assert entry_of(first).factors["mass"] == "light (0.02 kg)"
    assert (entry_of(practice).role, entry_of(first).role) == ("practice", "test")
    assert "mass light (0.02 kg)" in entry_of(first).condition


# --- the analysis ------------------------------------------------------------------------------------------------


def test_every_table_of_the_analysis_has_every_factor(tables: Path) -> None:
    for name in ("trials", "movements", "blocks", "people"):
        rows = [row for row in rows_of(tables / f"{name}.csv") if row["role"] == "test"]
        expected = {factor: levels for factor, levels in COLUMNS.items() if factor != "factor_gain" or name != "blocks"}
        check_columns(rows, expected)
    assert set(COLUMNS) <= set(rows_of(tables / "exclusions.csv")[0])
    assert set(COLUMNS) <= set(pd.read_parquet(tables / "paths.parquet").columns)


def test_data_dictionary_has_the_unit_of_every_numeric_factor(tables: Path) -> None:
    described = json.loads((tables / "dictionary.json").read_text(encoding="utf-8"))["tables"]
    for name, (unit, _) in VALUES.items():
        assert described["trials"]["columns"][name]["unit"] == unit
    assert "heavy (0.05 kg)" in described["trials"]["columns"]["factor_mass"]["description"]


def test_no_condition_pools_levels_of_a_factor(study: StudyData) -> None:
    names = {condition.name for condition in conditions(study)}
    assert len(names) == 2 * 2 * 2 * 2
    assert set(study.counted["condition"]) <= names
    for _, trials in study.counted.groupby("condition"):
        assert all(trials[column].nunique() == 1 for column in COLUMNS)


def test_figures_state_the_factors_pooled_over(study: StudyData) -> None:
    fewer, console_text = bounded(study)
    assert len(conditions(fewer)) <= 6
    assert console_text.startswith("Pooled over gain (weak (0.5), strong (1)); ")
    assert len(fewer.counted) == len(study.counted)
    assert fewer.trials[list(COLUMNS)].equals(study.trials[list(COLUMNS)])


def test_models_have_numeric_factors_as_terms_with_units(study: StudyData) -> None:
    (times, *_) = fits(study).fits
    names = {effect.name for effect in times.model.effects}
    assert {"mass per 0.01 kg", "gain per 0.1", "age per 10 y", "haptics: partner's force vs haptics on"} <= names
    assert {"mass per 0.01 kg, gain 0.5", "mass per 0.01 kg, gain 1"} <= names
    assert not any("[" in name for name in names)


def test_each_level_is_compared_with_the_first_within_conditions(study: StudyData) -> None:
    names = {comparison.question.name for comparison in comparisons(study).parts}
    assert any(name.startswith("mass heavy (0.05 kg) vs light (0.02 kg), dyadic") for name in names)
    assert any(name.startswith("gain strong (1) vs weak (0.5), dyadic") for name in names)


def test_report_lists_the_factors(study: StudyData) -> None:
    rows = {row[0]: row for row in design(study).factors.rows}
    assert rows["mass [kg]"][1:] == ("between blocks", "numeric", "light (0.02 kg), heavy (0.05 kg)", "yes")
    assert rows["gain [1]"][1] == "within blocks"
    assert rows["age [y]"][1] == "between dyads"


def test_practice_is_excluded_by_role_and_listed(study: StudyData) -> None:
    practice = study.trials[study.trials["role"] == "practice"]
    assert len(practice)
    assert not practice["counts"].any()
    assert set(study.exclusions.loc[study.exclusions["recording"].isin(practice["recording"]), "why"]) == {
        "in a practice block"
    }
    assert not any("practice" in condition.name for condition in conditions(study))


def test_practice_trials_form_a_separate_condition_if_included(recordings: tuple[Path, ...]) -> None:
    readings = parse("", overrides=["exclusions.roles=[]"])
    found = study_of([measure(run, readings) for run in runs_of(recordings)], readings)
    assert "dyadic, haptics on, practice" in {condition.name for condition in conditions(found)}
    assert set(found.counted.loc[found.counted["role"] == "practice", "condition"]) == {"dyadic, haptics on, practice"}


# --- exports -----------------------------------------------------------------------------------------------------


@pytest.mark.sampled(1, of="factors in exports")
def test_csv_has_every_factor(recordings: tuple[Path, ...], tmp_path: Path) -> None:
    export(recordings, "csv", tmp_path / "csv", lambda *_: None)
    rows = rows_of(tmp_path / "csv" / "trials.csv")
    assert {row["role"] for row in rows} == {"practice", "test"}
    check_columns([row for row in rows if row["role"] == "test"])
    described = json.loads((tmp_path / "csv" / "dictionary.json").read_text(encoding="utf-8"))["tables"]["trials"]
    assert described["columns"]["factor_mass_value"]["unit"] == "kg"


@pytest.mark.sampled(1, of="factors in exports")
def test_bids_has_every_factor_and_is_valid(recordings: tuple[Path, ...], tmp_path: Path) -> None:
    folder = tmp_path / "bids"
    export(recordings, "bids", folder, lambda *_: None)
    events = [row for path in folder.rglob("*_events.tsv") for row in rows_of(path, "\t")]
    check_columns([row for row in events if row["role"] == "test"], missing="n/a")
    scans = [row for path in folder.rglob("*_scans.tsv") for row in rows_of(path, "\t")]
    check_columns(scans, {name: COLUMNS[name] for name in ("factor_mass", "factor_felt", "factor_age")}, "n/a")
    assert {row["role"] for row in scans} == {"practice", "test"}
    people = rows_of(folder / "participants.tsv", "\t")
    check_columns(people, {"factor_age": COLUMNS["factor_age"]})
    (sidecar,) = folder.glob("*_events.json")
    described = json.loads(sidecar.read_text(encoding="utf-8"))
    assert all(described[name]["Units"] == unit for name, (unit, _) in VALUES.items())
    assert set(described["factor_mass"]["Levels"]) == {"light", "heavy"}
    tool = shutil.which("bids-validator-deno", path=Path(sys.executable).parent)
    if tool is not None:
        words = [tool, "--format", "json", "--max-rows", "-1", str(folder)]
        done = subprocess.run(words, capture_output=True, check=False, timeout=200)
        found = json.loads(done.stdout)["issues"]["issues"]
        assert not [issue for issue in found if issue["severity"] == "error"]


@pytest.mark.sampled(1, of="factors in exports")
def test_nwb_has_every_factor(recordings: tuple[Path, ...], tmp_path: Path) -> None:
    pynwb = pytest.importorskip("pynwb")
    export(recordings, "nwb", tmp_path / "nwb", lambda *_: None)
    found: list[dict[str, str]] = []
    for path in (tmp_path / "nwb").rglob("*.nwb"):
        with pynwb.NWBHDF5IO(path, "r") as io:
            trials = io.read().trials
            assert trials["factor_mass_value"].description.endswith("[kg]")
            found += trials[:].astype(str).to_dict("records")
    check_columns([row for row in found if row["role"] == "test"])


def test_xdf_has_every_factor(recordings: tuple[Path, ...], tmp_path: Path) -> None:
    pyxdf = pytest.importorskip("pyxdf")
    export(recordings[:3], "xdf", tmp_path / "xdf", lambda *_: None)
    path = tmp_path / "xdf" / f"{recordings[1].stem}.xdf"
    streams = {stream["info"]["name"][0]: stream for stream in pyxdf.load_xdf(path, dejitter_timestamps=False)[0]}
    (note,) = streams["netboard.markers"]["info"]["desc"][0]["design"]
    assert note["factor_mass"] == ["light (0.02 kg)"]
    assert note["role"] == ["test"]
    events = [json.loads(sample[0]) for sample in streams["netboard.events"]["time_series"]]
    gains = {event["details"]["factor_gain"] for event in events if event["name"] == "level"}
    assert gains <= {"weak (0.5)", "strong (1)"}
    assert gains
    assert {event["details"]["role"] for event in events if event["name"] == "level"} == {"test"}
