"""The command ``netboard simulate``: input files, output files, and messages."""

import json
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner, Result

from netboard.physics.simulation import OFFLINE_METHODS
from netboard.services.cli import app

COLUMNS = ["t", "z", "vz", "theta", "omega", "p", "vp", "f_left", "f_right"]
runner = CliRunner()


def write_hands(name: str, phase: float = 0.0, rate: int = 1000) -> None:
    t = np.arange(rate // 5 + 1) / rate
    z, vz = 0.02 * np.sin(5 * t + phase), 0.1 * np.cos(5 * t + phase)
    Path(name).parent.mkdir(exist_ok=True)
    np.savetxt(
        name, np.stack([t, z, vz, -z, -vz], 1), "%.17g", ",", header="t,z_left,v_left,z_right,v_right", comments=""
    )


def read(name: str) -> dict[str, np.ndarray]:
    with Path(name).open(encoding="ascii") as file:
        names = file.readline().strip().split(",")
        return dict(zip(names, np.loadtxt(file, delimiter=",").T, strict=True))


def simulate(*words: str) -> Result:
    return runner.invoke(app, ["simulate", *words])


@pytest.fixture(autouse=True)
def _a_folder_with_hands(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    monkeypatch.setenv("NO_COLOR", "1")
    write_hands("a.csv")


def test_one_file_is_simulated_and_summarised() -> None:
    result = simulate("--input", "a.csv", "--output", "out.csv")
    assert result.exit_code == 0, result.output
    found = read("out.csv")
    assert list(found) == COLUMNS
    assert found["t"].tolist() == [i / 1000 for i in range(201)]
    assert all(found[name][0] == 0.0 for name in COLUMNS[:7])
    assert "paper model, free board, 1 free ball" in result.output
    assert "taylor, in steps and orders that keep its error below 1e-12 of the speed" in result.output
    for line in ("samples      201", "every        1 ms", "rows         201", "steps        200, at most 1 ms"):
        assert line in result.output


@pytest.mark.slow
def test_files_simulated_together_give_the_same_bits_as_alone() -> None:
    write_hands("more/b.csv", 1.0, rate=240)
    write_hands("more/c.csv", 2.0)
    together = simulate("--input", "a.csv", "--input", "more", "--output", "all/")
    assert together.exit_code == 0, together.output
    for name in ("a.csv", "more/b.csv", "more/c.csv"):
        assert simulate("-i", name, "-o", "alone.csv", "--force").exit_code == 0
        assert Path("alone.csv").read_bytes() == Path("all", Path(name).name).read_bytes()
        assert name in together.output


def test_patterns_may_be_expanded_by_the_shell_or_not() -> None:
    write_hands("b.csv")
    assert simulate("-i", "?.csv", "-o", "one/{}_out.csv").exit_code == 0
    assert simulate("-i", "a.csv", "b.csv", "-o", "two/{}_out.csv").exit_code == 0
    for folder in ("one", "two"):
        assert sorted(path.name for path in Path(folder).iterdir()) == ["a_out.csv", "b_out.csv"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--set", "physics.ball_height=0.02"), 'ball_height: found 0.02, which needs model = "lagrangian"'),
        (("--model", "lagrangian", "--set", 'physics.ball_sign="printed"'), 'ball_sign: found "printed"'),
        (("--set", "physics.balls=0", "--set", "physics.b_p=1"), "b_p: found 1, which needs balls = 1 or more"),
    ],
)
def test_scene_with_a_key_that_would_have_no_effect_is_refused(words: tuple[str, ...], message: str) -> None:
    result = simulate("--input", "a.csv", "--output", "out.csv", *words)
    assert result.exit_code == 2
    assert message in result.output
    assert not Path("out.csv").exists()


def test_scene_comes_from_a_file_and_command_line_options() -> None:
    Path("scene.toml").write_text(
        "[physics]\nk_h = 300.0\nmodel = 'lagrangian'\n[block]\ntrials = 3\n", encoding="utf-8"
    )
    results = []
    for words in (
        ("--scene", "scene.toml"),
        ("--set", "physics.k_h=300", "--model", "lagrangian"),
        ("--scene", "scene.toml", "--model", "paper"),
        ("--set", "physics.k_h=300"),
    ):
        result = simulate("-i", "a.csv", "-o", "out.csv", "--force", *words)
        assert result.exit_code == 0, result.output
        results.append(Path("out.csv").read_bytes())
    assert results[0] == results[1] != results[2] == results[3]


def test_netboard_toml_in_the_working_folder_is_ignored() -> None:
    assert simulate("-i", "a.csv", "-o", "one.csv").exit_code == 0
    Path("netboard.toml").write_text("[physics]\nk_h = 300.0\n", encoding="utf-8")
    assert simulate("-i", "a.csv", "-o", "two.csv").exit_code == 0
    assert Path("one.csv").read_bytes() == Path("two.csv").read_bytes()


def test_initial_state_is_set_by_options() -> None:
    words = ["--z0", "-0.001", "--vz0", "0.01", "--theta0", "0.02", "--omega0", "-0.1", "--p0", "-0.15", "--v0", "0.05"]
    assert simulate("-i", "a.csv", "-o", "out.csv", *words).exit_code == 0
    found = read("out.csv")
    assert [found[name][0] for name in COLUMNS[1:7]] == [-0.001, 0.01, 0.02, -0.1, -0.15, 0.05]


@pytest.mark.slow
@pytest.mark.parametrize("places", [["--p0", "0.1,-0.1"], ["--p0", "0.1", "--p0", "-0.1"]])
def test_several_balls_have_their_own_columns(places: list[str]) -> None:
    words = ["--set", "physics.balls=2", "--method", "euler", *places]
    assert simulate("-i", "a.csv", "-o", "out.csv", *words).exit_code == 0
    found = read("out.csv")
    assert list(found) == ["t", "z", "vz", "theta", "omega", "p", "vp", "p2", "vp2", "f_left", "f_right"]
    assert (found["p"][0], found["p2"][0]) == (0.1, -0.1)


def test_fixed_ball_stays_in_place() -> None:
    result = simulate("-i", "a.csv", "-o", "out.csv", "--ball", "fixed", "--p0", "0.1")
    assert result.exit_code == 0
    assert "1 fixed ball" in result.output
    assert set(read("out.csv")["p"]) == {0.1}


@pytest.mark.parametrize("hold", ["zoh", "cv", "ca"])
def test_extrapolations_differ_from_interpolation(hold: str) -> None:
    assert simulate("-i", "a.csv", "-o", "best.csv").exit_code == 0
    assert simulate("-i", "a.csv", "-o", f"{hold}.csv", "--hold", hold).exit_code == 0
    off = np.abs(read("best.csv")["f_left"] - read(f"{hold}.csv")["f_left"]).max()
    assert 1e-7 < off < 0.1


def test_method_is_chosen_by_name() -> None:
    result = simulate("-i", "a.csv", "-o", "out.csv", "--method", "rk4", "--dt", "0.0005", "--substeps", "2")
    assert result.exit_code == 0
    assert "rk4, as requested" in result.output
    assert "800, at most 0.25 ms" in result.output
    result = simulate("-i", "a.csv", "-o", "new.csv", "--method", "rk5")
    assert result.exit_code == 2
    assert f'method: found "rk5", expected auto or one of {", ".join(OFFLINE_METHODS)}' in result.output


def test_energy_option_adds_balanced_energy_columns() -> None:
    result = simulate("-i", "a.csv", "-o", "out.csv", "--energy")
    assert result.exit_code == 0
    found = read("out.csv")
    assert list(found)[:9] == COLUMNS
    assert {name[:2] for name in list(found)[9:]} == {"E_", "W_"}
    assert "balanced to " in result.output
    assert simulate("-i", "a.csv", "-o", "b.csv", "--energy", "--hold", "ca").exit_code == 2


def test_energy_of_a_board_too_stiff_for_the_rows_is_refused() -> None:
    light = (f"physics.{key}" for key in ("M=1e-9", "I=1e-12", "c_h=100", "k_h=10000", "l=2"))
    scene = [word for one in light for word in ("--set", one)]
    start = ("--method", "etdrk4", "--theta0", "0.5")
    result = simulate("-i", "a.csv", "-o", "out.csv", "--energy", *start, *scene)
    assert result.exit_code == 2
    assert "a.csv: --energy: " in result.output
    assert not Path("out.csv").exists()


def test_parquet_metadata_give_the_provenance() -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    assert simulate("-i", "a.csv", "-o", "out.csv", "--p0", "0.1").exit_code == 0
    assert simulate("-i", "a.csv", "-o", "out.parquet", "--p0", "0.1").exit_code == 0
    table = parquet.read_table("out.parquet")
    for name, column in read("out.csv").items():
        assert table.column(name).to_numpy().tobytes() == column.tobytes()
    about = json.loads(table.schema.metadata[b"netboard"])
    assert about["input"] == "a.csv"
    assert about["p0"] == "(0.1,)"
    assert "k_h = 200.0" in about["configuration"]


def test_velocity_that_contradicts_the_position_is_reported() -> None:
    text = Path("a.csv").read_text(encoding="ascii").splitlines()
    rows = np.array([[float(word) for word in line.split(",")] for line in text[1:]])
    rows[:, 2] *= -1
    np.savetxt("odd.csv", rows, "%.17g", ",", header=text[0], comments="")
    result = simulate("-i", "odd.csv", "-o", "out.csv")
    assert result.exit_code == 0
    assert "odd.csv: v_left is not the rate of z_left: it makes -1 times the movement" in result.output


def test_unstable_method_is_reported() -> None:
    result = simulate("-i", "a.csv", "-o", "out.csv", "--method", "rk4", "--set", "physics.c_h=9")
    assert result.exit_code == 0
    words = " ".join(result.output.split())  # however the lines are wrapped
    assert "a.csv: rk4 is unstable for this scene in steps of 1 ms: the result is invalid" in words


# --- what is refused ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["-i", "none.csv"], "netboard: none.csv: cannot be read: No such file or directory"),
        (["-i", "a.csv", "--scene", "none.toml"], "netboard: none.toml: cannot be read: No such file or directory"),
        (["-i", "a.csv", "--set", "physics.k=3"], "--set: [physics] k: unknown key; "),
        (["-i", "a.csv", "--set", "physics.k_h=-3"], "--set: [physics] k_h: found -3, expected a number >= 0"),
        (["-i", "a.csv", "--dt", "0"], "netboard: a.csv: dt: found 0, expected from 1e-09 s to the 0.2 s of the hands"),
        (["-i", "a.csv", "--p0", "left"], "netboard: --p0: found left, expected numbers separated by commas"),
        (
            ["-i", "a.csv", "--p0", "0,0"],
            "--p0, --v0: found 2 and 0 values, expected none or one for each ball; the scene has 1",
        ),
        (["-i", "a.csv", "--ball", "fixed", "--v0", "1"], "netboard: v0: found 1, expected 0: the ball is fixed"),
        (["-i", "a.csv", "--z0", "nan"], 'found "nan", expected a number'),
        (["-i", "a.csv", "--method", "exact"], '"exact", which is for boards that cannot tilt'),
    ],
)
def test_invalid_options_are_refused(words: list[str], message: str) -> None:
    result = simulate("-o", "out.csv", *words)
    assert result.exit_code == 2
    assert message in result.output
    assert not Path("out.csv").exists()


@pytest.mark.parametrize("words", [[], ["-i", "a.csv"], ["-i", "a.csv", "-o", "b.csv", "--hold", "none"]])
def test_wrong_usage_exits_with_code_2(words: list[str]) -> None:
    assert simulate(*words).exit_code == 2


def test_existing_result_is_overwritten_only_with_force() -> None:
    Path("out.csv").write_text("mine", encoding="ascii")
    result = simulate("-i", "a.csv", "-o", "out.csv")
    assert result.exit_code == 2
    assert "netboard: out.csv: already exists; name another output, or overwrite it with --force" in result.output
    assert Path("out.csv").read_text(encoding="ascii") == "mine"
    assert simulate("-i", "a.csv", "-o", "out.csv", "--force").exit_code == 0
    assert list(read("out.csv")) == COLUMNS


def test_invalid_file_does_not_stop_the_others() -> None:
    write_hands("c.csv")
    Path("b.csv").write_text("t,z_left,v_left,z_right,v_right\n0,0,0,0,0\n1,0,0,x,0\n", encoding="ascii")
    result = simulate("-i", "*.csv", "-o", "all")
    assert result.exit_code == 2
    assert 'netboard: b.csv: line 3, column z_right: found "x", expected a number [m]' in result.output
    assert sorted(path.name for path in Path("all").iterdir()) == ["a.csv", "c.csv"]


def test_diverging_method_reports_the_time_and_leaves_no_file() -> None:
    result = simulate("-i", "a.csv", "-o", "out.csv", "--method", "euler", "--set", "physics.c_h=100")
    assert result.exit_code == 2
    assert "netboard: a.csv: the state is not finite from t = 0.0" in result.output
    assert [path.name for path in Path().iterdir()] == ["a.csv"]
