"""The configuration: valid values are read exactly, errors name table, key and remedy."""

import math
import re
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter

from netboard.base.config import Config, digest, parse, require_effective, resolve, template
from netboard.base.errors import ConfigError
from netboard.base.settings import Key, SettingsTable, about, read, tables, to_toml
from netboard.base.tables.experiment import Session
from netboard.base.tables.rig import Agent, Agents
from netboard.base.tables.scene import Physics
from netboard.task.studies.study import Study

ALL = [(table, key) for table in tables(Config) for key in table.keys]
QUANTITIES = [(table, key) for table, key in ALL if key.unit]
NAMED = {"ids": lambda part: part.name if isinstance(part, SettingsTable | Key) else str(part)}


def problems(text: str, *overrides: str) -> list[str]:
    with pytest.raises(ConfigError) as raised:
        parse(text, "rig.toml", overrides)
    return str(raised.value).splitlines()


# --- what is right -----------------------------------------------------------------------------------------------


def test_empty_text_gives_the_defaults() -> None:
    assert parse("") == Config()


def test_defaults_equal_table_1_of_the_paper() -> None:
    physics, geometry = Config().physics, Config().geometry
    assert (physics.M, physics.m, physics.l, physics.I) == (0.01, 0.05, 0.25, 0.0004)
    assert (physics.k_h, physics.c_h, physics.k_s, physics.g) == (200.0, 2.0, 140.0, 9.81)
    assert (geometry.board_length, geometry.target_distance, geometry.target_width) == (0.7, 0.15, 0.07)
    assert (Config().task.hold_time, Config().block.trials) == (1.5, 60)


def test_integer_is_accepted_for_a_float() -> None:
    mass = parse("[physics]\nM = 1").physics.M
    assert type(mass) is float
    assert mass == 1.0


def test_options_keep_their_types() -> None:
    text = '[agents.left.options]\nport = 3\ngain = 3.0\nheld = true\n"any key" = "text"'
    options = parse(text).agents.left.options
    assert repr(options) == "{'port': 3, 'gain': 3.0, 'held': True, 'any key': 'text'}"


@pytest.mark.slow
def test_resolved_text_is_complete_and_parses_to_the_same_configuration() -> None:
    config = parse("[physics]\nM = 0.1\n[agents.right]\ndevice = 'mouse'")
    assert parse(resolve(config)) == config
    for table, key in ALL:
        assert f"[{table.name}.{key.name}]" in resolve(config) or re.search(
            rf"^\[{table.name}\]$(?:\n(?!\[).*)*?\n{key.name} = ", resolve(config), re.MULTILINE
        )


FLOATS = st.floats(allow_nan=False) | st.sampled_from([-0.0, 5e-324, math.inf, 1e22, 0.1 + 0.2])
OPTIONS = st.dictionaries(st.text(), st.text() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | FLOATS, max_size=4)


@pytest.mark.slow
@given(
    stiffness=st.floats(0.0, 10.0),
    zero=st.floats(-1, 1),
    seed=st.integers(0, 2**31 - 1),
    folder=st.text(min_size=1),
    options=OPTIONS,
)
def test_configuration_round_trip_is_bit_exact(
    stiffness: float, zero: float, seed: int, folder: str, options: dict[str, Any]
) -> None:
    config = Config(
        physics=Physics(k_h=stiffness),
        agents=Agents(left=Agent(device=folder, zero=zero, options=options)),
        block=replace(Config().block, seed=seed),
        recording=replace(Config().recording, directory=folder),
    )
    again = parse(resolve(config))
    assert again == config
    assert repr(again) == repr(config)  # distinguishes -0.0 from 0.0 and True from 1
    assert digest(again) == digest(config)


def test_template_parses_to_the_defaults_and_explains_every_key() -> None:
    assert parse(template()) == Config()
    lines = template().splitlines()
    for table, key in ALL:
        start = lines.index(f"[{table.name}]")
        wanted = (f"{key.name} = ", f"[{table.name}.{key.name}]")
        line = next(line for line in lines[start + 1 :] if line.startswith(wanted))
        assert key.text in line
        assert f"[{key.unit}]" in line or not key.unit
        assert key.limits in line


def test_digest_distinguishes_configurations() -> None:
    other = replace(Config(), physics=Physics(M=math.nextafter(0.01, 1)))
    assert re.fullmatch("[0-9a-f]{64}", digest(Config()))
    assert digest(other) != digest(Config())
    assert digest(parse(template())) == digest(Config())


# --- what is wrong -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("table", "key"), ALL, **NAMED)
def test_wrong_type_error_names_table_key_and_expected_type(table: SettingsTable, key: Key) -> None:
    (problem,) = problems(f"[{table.name}]\n{key.name} = [[1]]")
    if not isinstance(key.default, dict):
        assert problem == f"rig.toml: [{table.name}] {key.name}: found a list, expected {key.expected} ({key.text})"


@pytest.mark.parametrize(("table", "key"), QUANTITIES, **NAMED)
def test_values_beyond_limits_and_infinity_are_refused(table: SettingsTable, key: Key) -> None:
    limits = re.findall(r"(>=|>|<=|<) (\S+)", key.limits)
    assert len(limits) == 2
    for sign, bound in limits:
        number = float(bound) if "." in bound or "e" in bound else int(bound)
        step = 1 if isinstance(key.default, int) else 1e-9
        outside = number if sign in "<>" else number + step * (1 if "<" in sign else -1)
        for value in (to_toml(outside), "-inf" if ">" in sign else "inf", "nan"):
            (problem,) = problems(f"[{table.name}]\n{key.name} = {value}")
            assert problem.startswith(
                f"rig.toml: [{table.name}] {key.name}: found {value}, expected {key.kind} > "
            ) or (problem.startswith(f"rig.toml: [{table.name}] {key.name}: found {value}, expected {key.kind} >= "))


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            '[physics]\nM = "10 g"',
            '[physics] M: found "10 g", expected a number >= 1e-09 and <= 10 [kg] (mass of the board)',
        ),
        ("[physics]\nM = true", "[physics] M: found true, expected a number"),
        ("[physics]\nM = 5e-324", "[physics] M: found 5e-324, expected a number >= 1e-09 "),
        ("[physics]\nI = 1e-20", "[physics] I: found 1e-20, expected a number >= 1e-12 "),
        ("[block]\ntrials = 1.5", "[block] trials: found 1.5, expected a whole number >= 1 and <= 10000 "),
        ("[session]\npilot = 1", "[session] pilot: found 1, expected true or false "),
        ('[block]\nfirst_target = "up"', 'found "up", expected "left" or "right" or "random" '),
        (
            '[session]\nname = "a b"',
            'found "a b", expected text of at most 80 letters, digits, - and _, such as D03 (label',
        ),
        ('[network]\nhost = ""', 'found "", expected text of at least one character '),
        ("[agents.left.options]\nx = [1]", "[agents.left] options.x: found a list, expected text, a number, "),
        ("physics = 3", "[physics]: found 3, expected a table"),
        ("[agents]\nleft = 3", "[agents.left]: found 3, expected a table"),
        ("[physics]\nkh = 1", "[physics] kh: unknown key; did you mean k_h (a number >= 0 and <= 10000 [N/m])?"),
        ("[task]\nHold_Time = 1", "[task] Hold_Time: unknown key; did you mean hold_time ("),
        ("[task]\ntrials = 6", "[task] trials: unknown key; it belongs in [block]"),
        ("[session]\nxyzzy = 6", "[session] xyzzy: unknown key; there are name, dyad, pilot"),
        ("[phisics]\nM = 1", "[phisics]: unknown table; did you mean [physics]?"),
        ("[agents.lef]\nzero = 1", "[agents.lef]: unknown table; did you mean [agents.left]?"),
        ("M = 1", "M: unknown table; it belongs in [physics]"),
        ("x = = 1", "not valid TOML: Invalid value (at line 1, column 5)"),
        ("[block]\ntrials = 1\ntrials = 2", "not valid TOML: Cannot overwrite a value (at "),
        (f"x = {'[' * 100_000}", "lists or tables are nested too deeply"),
        (f"{'x . ' * 20_000}x = 1", "lists or tables are nested too deeply"),
    ],
)
def test_each_problem_is_reported_in_one_line(text: str, problem: str) -> None:
    (line,) = problems(text)
    assert line.startswith("rig.toml: ")
    assert problem in line


@pytest.mark.parametrize("number", ["true", '"0.5"', "nan", "inf"])
def test_lists_hold_finite_numbers_only(number: str) -> None:
    (problem,) = problems(f"[block]\ntrial_scales = [1, {number}]")
    assert "[block] trial_scales: found" in problem
    assert "expected a list of numbers" in problem
    (problem,) = problems(f"[design.values]\ngain = [1, {number}]")
    assert "[design] values.gain: found" in problem


@pytest.mark.parametrize("cpus", ["1-", "-", "2,,3", "2,", "0-3-5", "99999999999", "0-9999999999999"])
def test_malformed_list_of_cpus_is_refused(cpus: str) -> None:
    (problem,) = problems(f'[realtime]\nserver_cpus = "{cpus}"')
    expected = "expected text with numbers and ranges of CPUs, such as 2 or 0,2-3, or auto (CPUs of the server; "
    assert f'[realtime] server_cpus: found "{cpus}", {expected}' in problem


@pytest.mark.parametrize("cls", [Config, Study])
def test_no_form_of_a_text_is_described_by_a_regular_expression(cls: type) -> None:
    for table in tables(cls):
        assert not [key.name for key in table.keys if "[" in key.limits or "^" in key.limits], table.name


@pytest.mark.parametrize("cpus", ["", "auto", "3", "0,2-3", "0-1,4-7,9"])
def test_list_of_cpus_is_accepted(cpus: str) -> None:
    assert parse(f'[realtime]\nagent_cpus = "{cpus}"').realtime.agent_cpus == cpus


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (
            '[network]\nhost = "fe80::1"',
            '[network] host: found "fe80::1", a link-local address, expected its network interface, too',
        ),
        ('[network]\nbind = "[FE80::1]"', '[network] bind: found "[FE80::1]", a link-local address, expected'),
        ("[agents.left]\nstop_buttons = 3\nconsent_buttons = 2", "stop_buttons, consent_buttons: found 2 in both"),
        ('[realtime]\nagent_cpus = "0,3-1"', 'agent_cpus: found "3-1", expected "1-3"'),
        (
            "[display]\nlink_timeout_ms = 20",
            "link_timeout_ms: found 20, expected at least 100, because views can be 50 ms",
        ),
        (
            "[network]\nview_rate_hz = 2",
            "link_timeout_ms: found 500, expected at least 1000, because views can be 500 ms",
        ),
    ],
)
def test_settings_that_defeat_each_other_are_refused_outside_of_old_recordings(text: str, problem: str) -> None:
    with pytest.raises(ConfigError, match=re.escape(problem)):
        require_effective(parse(text), "test")


def test_all_problems_are_reported_at_once() -> None:
    lines = problems("[physics]\nMass = 1\nm = -1\n[block]\ntrials = 'six'\n[nowhere]\n")
    assert len(lines) == 4
    assert {line.split(": ")[1] for line in lines} == {"[physics] Mass", "[physics] m", "[block] trials", "[nowhere]"}


AT_BOTH = "[physics]\ncoupling_at = 'both'\n[block]\n"


def test_coupling_at_both_ends_allows_full_or_no_force() -> None:
    assert parse(AT_BOTH).block.haptics
    assert not parse(AT_BOTH + "force = 'none'").block.haptics


@pytest.mark.parametrize(
    ("text", "key"),
    [
        (
            "[geometry]\ntarget_distance = 0.32\n[task]\nfall_distance = 0.36",
            "[geometry] target_distance, target_width",
        ),
        ("[geometry]\ntarget_distance = 0.01", "[geometry] target_distance"),
        ("[physics]\nl = 0.36", "[physics] l"),
        ("[task]\nfall_distance = 0.18", "[task] fall_distance"),
        ("[task]\nfall_distance = 0.40", "[task] fall_distance"),
        ("[task]\nstylus_range = 0.25", "[task] stylus_range"),
        ("[task]\nlevel_height = 0.08", "[task] level_height"),
        ("[safety]\nstale_after_ms = 4", "[safety] stale_after_ms"),
        ("[safety]\nfade_ms = 95", "[safety] disarm_after_ms"),
        ("[safety]\nmax_force = 0.1", "[safety] arm_gate"),
        ("[physics]\nballs = 0\nball_inertia = 0.4", "[physics] ball_inertia"),
        ("[physics]\nballs = 0\nball_stop = 0.3", "[physics] ball_stop"),
        ("[physics]\nball_stop = 0.1", "[physics] ball_stop"),
        ("[physics]\nrestitution = 0.5", "[physics] restitution"),
        ("[physics]\nball_height = 0.02", "[physics] ball_height"),
        ("[physics]\nmodel = 'lagrangian'\nballs = 0\nball_height = 0.02", "[physics] ball_height"),
        ("[physics]\nmodel = 'lagrangian'\nball_sign = 'printed'", "[physics] ball_sign"),
        ("[physics]\nboard = 'hinged'\nb_z = 0.1", "[physics] b_z"),
        ("[physics]\nboard = 'level'\nb_theta = 0.1", "[physics] b_theta"),
        ("[physics]\nmethod = 'exact'", "[physics] method"),
        ("[block]\nleft = 'still'\nright = 'still'", "[block] left, right"),
        ("[block]\nconfiguration = 'bimanual'\nleft = 'robot'\nright = 'robot'", "[block] left, right"),
        ("[block]\ncatch = [3, 0]", "[block] catch"),
        ("[block]\ncatch = [10001]", "[block] catch"),
        (AT_BOTH + "force = 'partner_only'", "[block] force"),
        (AT_BOTH + "force_scale = 0.5", "[block] force_scale"),
        (AT_BOTH + "force_delay_ms = 20", "[block] force_delay_ms"),
        (AT_BOTH + "catch = [3]", "[block] catch"),
        (AT_BOTH + "left = 'robot'", "[block] left"),
        (AT_BOTH + "right = 'still'", "[block] right"),
    ],
)
def test_contradictory_keys_are_refused(text: str, key: str) -> None:
    (line,) = problems(text)
    assert line.startswith(f"rig.toml: {key}: ")
    assert "expected" in line


# --- overrides ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("override", "value"),
    [
        ("block.trials=6", lambda config: config.block.trials == 6),
        ("session.pilot = true", lambda config: config.session.pilot is True),
        ("block.first_target=left", lambda config: config.block.first_target == "left"),
        ('block.first_target="left"', lambda config: config.block.first_target == "left"),
        ("session.dyad=007", lambda config: config.session == Session(dyad="007")),
        ("session.dyad=12", lambda config: config.session.dyad == "12"),
        ("recording.directory=/a=b/c", lambda config: config.recording.directory == "/a=b/c"),
        ("agents.left.options.held=false", lambda config: config.agents.left.options == {"held": False}),
    ],
)
def test_override_takes_precedence_over_the_file(override: str, value: Any) -> None:
    assert value(parse("[block]\ntrials = 2\nforce = 'full'\n[session]\nname = 'S01'", "rig.toml", [override]))


@pytest.mark.parametrize(
    ("override", "problem"),
    [
        ("trials=6", "--set trials=6: write table.key=value"),
        ("block.trials", "--set block.trials: write table.key=value"),
        ("block.label=gr\udcfc", "--set block.label=gr?: expected text in UTF-8"),
        ("block.trials=six", '--set: [block] trials: found "six", expected a whole number'),
        ("block.trails=6", "--set: [block] trails: unknown key; did you mean trials ("),
        ("blok.trials=6", "--set: [blok]: unknown table; did you mean [block]?"),
        ("task.stylus_range=0.3", "rig.toml with --set: [task] stylus_range: found 0.3"),
    ],
)
def test_invalid_override_is_named(override: str, problem: str) -> None:
    (line,) = problems("", override)
    assert line.startswith(problem)


def test_unknown_table_in_the_file_is_reported_despite_overrides() -> None:
    (line,) = problems("[blok]\ntrials = 5", "blok.trials=6")
    assert line.startswith("rig.toml: [blok]: unknown table")


def test_override_of_a_value_used_as_a_table_reports_the_file() -> None:
    (line,) = problems("physics = 3", "physics.M=1")
    assert line == "rig.toml: [physics]: found 3, expected a table"


# --- the reader itself -------------------------------------------------------------------------------------------


def test_setting_without_a_description_raises_a_type_error() -> None:
    from dataclasses import dataclass

    @dataclass(frozen=True)
    class Bare:
        x: float = 0.0

    with pytest.raises(TypeError, match="about"):
        read(TypeAdapter(Bare), Bare, "", "rig.toml")


def test_every_quantity_has_limits_and_every_key_a_description() -> None:
    for _, key in ALL:
        assert key.text
        assert key.limits or not key.unit
    assert about("x", "m", gt=0).description == "x"


@pytest.mark.parametrize(("was", "is_now"), [("true", "always"), ("false", "never")])
def test_full_screen_of_older_recordings_and_rigs_is_read(was: str, is_now: str) -> None:
    assert parse(f"[display]\nfullscreen = {was}").display.fullscreen == is_now
