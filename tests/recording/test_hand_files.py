"""Files of hands: accepted and refused content with messages; result files are complete or absent."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from netboard.base.errors import ConfigError, NetboardError
from netboard.physics.hands.sampled import Hands
from netboard.recording.export import formats
from netboard.recording.importing import hand_files
from netboard.recording.importing.hand_files import (
    HAND_COLUMNS,
    find_inputs,
    plan_outputs,
    read_hands,
    velocity_warnings,
    write_table,
)

HEADER = "t,z_left,v_left,z_right,v_right\n"
ROWS = "".join(f"{i / 1000},{i}e-3,{i}e-2,-{i}e-3,-{i}e-2\n" for i in range(5))


def file_of(folder: Path, text: str, name: str = "a.csv") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


# --- reading -----------------------------------------------------------------------------------------------------


def test_csv_columns_become_hand_positions_and_velocities(tmp_path: Path) -> None:
    hands = read_hands(file_of(tmp_path, HEADER + ROWS))
    assert hands.t.tolist() == [0.0, 0.001, 0.002, 0.003, 0.004]
    assert hands.z[3].tolist() == [0.003, -0.003]
    assert hands.vz[3].tolist() == [0.03, -0.03]


@pytest.mark.parametrize(
    "text",
    [
        "z_right,v_right,t,z_left,v_left\n" + "".join(f"-{i}e-3,-{i}e-2,{i / 1000},{i}e-3,{i}e-2\n" for i in range(5)),
        "\ufeff" + HEADER.replace(",", " , ") + ROWS,
        (HEADER + ROWS).replace("\n", "\r\n"),
        HEADER + ROWS.replace("\n", "\n\n"),
        HEADER.replace("t,", '"t",', 1) + ROWS.replace("0.001", '"0.001"'),
        (HEADER + ROWS).rstrip(),
        (HEADER + ROWS).replace(",", ";"),
        (HEADER + ROWS).replace(",", "\t"),
    ],
    ids=[
        *("order", "byte order mark and spaces", "carriage returns", "blank lines", "quotes", "no last line end"),
        *("semicolons", "tabs"),
    ],
)
def test_csv_variants_give_the_same_hands(tmp_path: Path, text: str) -> None:
    expected, found = read_hands(file_of(tmp_path, HEADER + ROWS)), read_hands(file_of(tmp_path, text, "b.csv"))
    for one, other in ((expected.t, found.t), (expected.z, found.z), (expected.vz, found.vz)):
        np.testing.assert_array_equal(one, other)


EXPECTED = "expected t,z_left,v_left,z_right,v_right"
REFUSED = {
    "empty": ("", "line 1: found nothing, expected the names of columns"),
    "no rows": (HEADER, "rows of numbers: found 0, expected at least 2"),
    "one row": (HEADER + "0,0,0,0,0\n", "rows of numbers: found 1, expected at least 2"),
    "no names": (
        ROWS,
        f'line 1: found "0.0, 0e-3, 0e-2, -0e-3, -0e-2", expected the names of the columns: {HEADER.strip()}',
    ),
    "missing": ("t,z_left,v_left\n", f"columns: z_right, v_right are missing; {EXPECTED}"),
    "unknown": (HEADER.strip() + ",trial\n", f"columns: trial is unknown; {EXPECTED}"),
    "misspelt": (
        HEADER.replace("v_left", "vleft"),
        f"columns: v_left is missing; vleft is unknown; is vleft meant to be v_left?; {EXPECTED}",
    ),
    "twice": (HEADER.strip() + ",t\n", f"columns: t is there twice; {EXPECTED}"),
    "a word": (
        HEADER + "0,0,0,0,0\n\n1e-3,0,fast,0,0\n",
        'line 4, column v_left: found "fast", expected a number [m/s]',
    ),
    "a hole": (
        HEADER + "0,0,0,0,0\n1e-3,,0,0,0\n",
        "line 3, column z_left: found nothing, expected a number [m]",
    ),
    "a short line": (HEADER + "0,0,0,0,0\n1e-3,0,0,0\n", "line 3: found 4 columns, expected 5"),
    "short lines": (HEADER + "0,0,0,0\n1e-3,0,0,0\n", "line 2: found 4 columns, expected 5"),
    "decimal commas": (
        HEADER + '"0,0",0,0,0,0\n',
        'line 2, column t: found "0,0", expected a number [s] with a decimal point',
    ),
    "a label": (HEADER + "0,0,0,0,0\n1e-3,0,0,1_1,0\n", 'line 3, column z_right: found "1_1", expected a number [m]'),
    "not a number": (
        HEADER + "0,0,0,0,0\n\n1e-3,0,nan,0,0\n2e-3,0,0,0,inf\n",
        'line 4, column v_left: found "nan", expected a number [m/s]',
    ),
    "time going back": (
        HEADER + "0,0,0,0,0\n2e-3,0,0,0,0\n1e-3,0,0,0,0\n",
        "line 4, column t: found 0.001 after 0.002, expected increasing times",
    ),
    "time standing still": (
        HEADER + "0,0,0,0,0\n0,0,0,0,0\n0,0,0,0,0\n",
        "line 3, column t: found 0 after 0, expected increasing times; there are 2 such",
    ),
    "millimetres": (
        HEADER + "0,0,0,0,0\n1e-3,0,0,-12.5,0\n",
        "line 3, column z_right: found -12.5, expected at most 1 m in each direction: are these mm?",
    ),
    "millimetres per second": (
        HEADER + "0,0,120,0,0\n1e-3,0,0,0,0\n",
        "line 2, column v_left: found 120, expected at most 50 m/s in each direction: are these mm/s?",
    ),
    "milliseconds": (
        HEADER + "0,0,0,0,0\n1,0,0,0,0\n2,0,0,0,0\n",
        "found samples 1 s apart (column t), expected at most 0.25 s: is t in ms?",
    ),
}


@pytest.mark.parametrize(("text", "words"), REFUSED.values(), ids=REFUSED)
def test_invalid_csv_is_refused_with_the_place(tmp_path: Path, text: str, words: str) -> None:
    path = file_of(tmp_path, text)
    with pytest.raises(ConfigError) as refusal:
        read_hands(path)
    assert str(refusal.value) == f"{path}: {words}"


def test_gaps_are_refused_unless_held(tmp_path: Path) -> None:
    times = [0, 1, 2, 3, 4, 5, 30, 31, 32, 80, 81, 82]
    path = file_of(tmp_path, HEADER + "".join(f"{t / 1000},0,0,0,0\n" for t in times))
    with pytest.raises(ConfigError) as refusal:
        read_hands(path)
    assert str(refusal.value) == (
        f"{path}: line 8, column t: found a gap of 0.025 s after t = 0.005 s, expected at most 3 times the usual "
        "0.001 s; there are 2 in all (--gaps hold goes on across them)"
    )
    assert len(read_hands(path, gaps="hold").t) == len(times)


def test_unreadable_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"b\.csv: cannot be read: No such file"):
        read_hands(tmp_path / "b.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(ConfigError, match=r"cannot be read: .*directory"):
        read_hands(tmp_path / "folder.csv")
    (tmp_path / "c.csv").write_bytes(HEADER.encode() + b"\xe9")
    with pytest.raises(ConfigError, match=r"c\.csv: line 2: is not UTF-8; save the file as UTF-8"):
        read_hands(tmp_path / "c.csv")


@settings(max_examples=200)
@given(text=st.text(st.sampled_from("0123456789.,-+e\n\"; \ttzv_leftrighna\r#'"), max_size=200), header=st.booleans())
def test_any_text_is_parsed_or_refused(tmp_path_factory: pytest.TempPathFactory, text: str, header: bool) -> None:
    path = file_of(tmp_path_factory.mktemp("any"), (HEADER if header else "") + text)
    try:
        message = f"{path}: {len(read_hands(path, gaps='hold').t)} samples"
    except ConfigError as refusal:
        message = str(refusal)
    assert message.startswith(f"{path}: ")


# --- rates that are not those of the heights ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("factor", "words"), [(1.0, ""), (-1.0, "makes -1 times"), (1000.0, "makes 1e+03 times"), (0.0, "makes 0 times")]
)
def test_velocity_that_contradicts_the_position_raises_a_doubt(factor: float, words: str) -> None:
    t = np.arange(1001) / 1000
    z, vz = 0.02 * np.sin(7 * t), 0.14 * np.cos(7 * t)
    found = velocity_warnings(Hands(t, np.stack([z, z], 1), np.stack([factor * vz, vz], 1)))
    assert len(found) == (1 if words else 0)
    assert not words or (found[0].startswith("v_left is not the rate of z_left: it ") and words in found[0])


def test_noise_and_lag_raise_no_doubt() -> None:
    random, t = np.random.default_rng(0), np.arange(3001) / 1000
    z, vz = 0.02 * np.sin(7 * t), 0.14 * np.cos(7 * (t - 0.01))
    z = np.round(z / 55e-6) * 55e-6
    hands = Hands(
        t, np.stack([z, 1e-5 * random.normal(size=3001)], 1), np.stack([vz, 0.01 * random.normal(size=3001)], 1)
    )
    assert velocity_warnings(hands) == []


# --- which files -------------------------------------------------------------------------------------------------


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "hands").mkdir()
    for name in ("hands/b.csv", "hands/a.csv", "hands/c.parquet", "hands/notes.txt", "a.csv", "[x].csv"):
        file_of(tmp_path, HEADER, name)
    return tmp_path


@pytest.mark.parametrize(
    ("words", "found"),
    [
        (["a.csv"], ["a.csv"]),
        (["hands"], ["hands/a.csv", "hands/b.csv", "hands/c.parquet"]),
        (["hands/*.csv"], ["hands/a.csv", "hands/b.csv"]),
        (["hands/b.csv", "hands/*.csv", "a.csv"], ["hands/b.csv", "hands/a.csv", "a.csv"]),
        (["[x].csv"], ["[x].csv"]),
    ],
)
@pytest.mark.usefixtures("folder")
def test_inputs_are_files_folders_or_patterns(words: list[str], found: list[str]) -> None:
    assert find_inputs(words) == [Path(name) for name in found]


def test_input_pattern_may_be_absolute(folder: Path) -> None:
    assert find_inputs([str(folder / "hands" / "?.csv")]) == [folder / "hands" / "a.csv", folder / "hands" / "b.csv"]


@pytest.mark.parametrize(
    ("word", "words"),
    [
        ("none*.csv", "none*.csv: there is no .csv or .parquet file"),
        ("hands/notes.txt", "hands/notes.txt: expected the name of a .csv or .parquet file"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_missing_or_unsupported_inputs_are_refused(word: str, words: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        find_inputs([word])
    assert str(refusal.value) == words


A, B, OTHER_A = Path("hands/a.csv"), Path("hands/b.csv"), Path("a.csv")


@pytest.mark.parametrize(
    ("inputs", "output", "found"),
    [
        ([A], "out.csv", ["out.csv"]),
        ([A], "out.parquet", ["out.parquet"]),
        ([A], "out", ["out/a.csv"]),
        ([A], "v1.2/", ["v1.2/a.csv"]),
        ([A], "out.CSV", ["out.CSV"]),
        ([A, B], "out_{}", ["out_a/a.csv", "out_b/b.csv"]),
        ([A, B], "out/", ["out/a.csv", "out/b.csv"]),
        ([A, B], "out/{}_moved.parquet", ["out/a_moved.parquet", "out/b_moved.parquet"]),
    ],
)
@pytest.mark.usefixtures("folder")
def test_output_paths_follow_from_the_inputs_and_the_pattern(inputs: list[Path], output: str, found: list[str]) -> None:
    assert plan_outputs(inputs, output) == dict(zip(inputs, map(Path, found), strict=True))


@pytest.mark.parametrize(
    ("inputs", "output", "words"),
    [
        (
            [A, B],
            "out.csv",
            "--output out.csv: found one file for 2 inputs, expected a folder, or a name with {} in it",
        ),
        ([A], "out.txt", "--output out.txt: expected a .csv or .parquet file, or a folder, as out.txt/"),
        ([A, OTHER_A], "out", "out/a.csv: would be the result of hands/a.csv and of a.csv; rename one"),
        ([A], "hands", "hands/a.csv: is an input; name another --output"),
        ([A], "./hands/../hands/a.csv", "hands/../hands/a.csv: is an input; name another --output"),
        ([A], "a.csv", "a.csv: already exists; name another output, or overwrite it with --force"),
    ],
)
@pytest.mark.usefixtures("folder")
def test_ambiguous_or_conflicting_outputs_are_refused(inputs: list[Path], output: str, words: str) -> None:
    with pytest.raises(ConfigError) as refusal:
        plan_outputs(inputs, output)
    assert str(refusal.value) == words


@pytest.mark.usefixtures("folder")
def test_force_overwrites_results_but_never_inputs() -> None:
    assert plan_outputs([A], "a.csv", force=True) == {A: OTHER_A}
    with pytest.raises(ConfigError, match=r"hands/a\.csv: is an input"):
        plan_outputs([A], "hands/a.csv", force=True)


# --- writing -----------------------------------------------------------------------------------------------------

NUMBERS = np.array([0.1, 1 / 3, -0.0, 5e-324, 1.7976931348623157e308, 1e22, 123456789.123456789, -2.5e-7])
COLUMNS = {"t": np.arange(8) / 1000, "z": NUMBERS, "vz": NUMBERS[::-1]}


def test_csv_round_trip_is_bit_exact(tmp_path: Path) -> None:
    path = tmp_path / "deep" / "out.csv"
    write_table(path, COLUMNS, {})
    assert path.read_bytes().startswith(b"t,z,vz\n0.0,0.1,-2.5e-07\n0.001,")
    back = np.loadtxt(path, delimiter=",", skiprows=1)
    assert back.tobytes() == np.stack(list(COLUMNS.values()), 1).tobytes()


def test_csv_written_in_portions_equals_csv_written_at_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    write_table(tmp_path / "once.csv", COLUMNS, {})
    monkeypatch.setattr(hand_files, "ROWS", 3)
    write_table(tmp_path / "often.csv", COLUMNS, {})
    assert (tmp_path / "once.csv").read_bytes() == (tmp_path / "often.csv").read_bytes()


def test_failed_write_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "out.csv"
    path.mkdir()
    with pytest.raises(NetboardError, match=r"out\.csv: cannot be written: "):
        write_table(path, COLUMNS, {}, force=True)
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(NetboardError, match="cannot be written: "):
        write_table(file_of(tmp_path, "") / "out.csv", COLUMNS, {})


def test_existing_file_is_overwritten_only_with_force(tmp_path: Path) -> None:
    path = file_of(tmp_path, "mine", "out.csv")
    with pytest.raises(ConfigError, match="already exists"):
        write_table(path, COLUMNS, {})
    assert [child.read_text() for child in tmp_path.iterdir()] == ["mine"]
    write_table(path, COLUMNS, {}, force=True)
    assert path.read_text(encoding="ascii").startswith("t,z,vz\n")


# --- Parquet -----------------------------------------------------------------------------------------------------


def test_parquet_round_trip_is_bit_exact(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "out.parquet"
    write_table(path, COLUMNS, {"made_by": "a test"})
    table = parquet.read_table(path)
    for name, column in COLUMNS.items():
        assert table.column(name).to_numpy().tobytes() == np.ascontiguousarray(column).tobytes()
    assert json.loads(table.schema.metadata[b"netboard"]) == {"made_by": "a test"}


def test_hands_in_parquet_equal_those_in_csv(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    csv = read_hands(file_of(tmp_path, HEADER + ROWS))
    values = (csv.t, csv.z[:, 0], csv.vz[:, 0], csv.z[:, 1], csv.vz[:, 1])
    write_table(tmp_path / "a.parquet", dict(zip(HAND_COLUMNS, values, strict=True)), {})
    found = read_hands(tmp_path / "a.parquet")
    for one, other in ((csv.t, found.t), (csv.z, found.z), (csv.vz, found.vz)):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(
    ("column", "words"),
    [
        ([0.0, None], "row 2, column v_left: found nothing, expected a number [m/s]"),
        (["a", "b"], 'row 1, column v_left: found "a", expected a number [m/s]'),
        ([0.0, float("nan")], 'row 2, column v_left: found "nan", expected a number [m/s]'),
    ],
)
def test_invalid_parquet_is_refused_with_the_place(tmp_path: Path, column: list[object], words: str) -> None:
    pyarrow, parquet = pytest.importorskip("pyarrow"), pytest.importorskip("pyarrow.parquet")
    path = tmp_path / "a.parquet"
    columns = {name: [0.0, 1e-3] for name in HAND_COLUMNS} | {"v_left": column}
    parquet.write_table(pyarrow.table(columns), path)
    with pytest.raises(ConfigError) as refusal:
        read_hands(path)
    assert str(refusal.value) == f"{path}: {words}"


def test_file_that_is_not_parquet_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("pyarrow")
    with pytest.raises(ConfigError, match=r"a\.parquet: not a Parquet file: "):
        read_hands(file_of(tmp_path, HEADER, "a.parquet"))


def test_missing_pyarrow_is_reported_with_the_install_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(formats, "import_module", missing)
    needed = r"this needs pyarrow, .* pip install 'netboard\[parquet\]'"
    with pytest.raises(ConfigError, match=needed):
        read_hands(file_of(tmp_path, "", "a.parquet"))
    with pytest.raises(ConfigError, match=needed):
        write_table(tmp_path / "b.parquet", COLUMNS, {})
