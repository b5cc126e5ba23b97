"""Device checkup on simulated readings."""

import numpy as np
import pytest
from simulated import AT_REST, Puppet, SimulatedTime, configured, virtual

from netboard.base.config import Config
from netboard.base.finding import Finding
from netboard.base.tables.rig import Safety
from netboard.devices.contract.device import DeviceInfo, Reading
from netboard.devices.contract.profile import Mechanics
from netboard.devices.setup import checkup
from netboard.devices.setup.loop import DeviceRun, Driver, track_of, watch
from netboard.participants.people.submovement import Submovement

INFO = DeviceInfo("it", "1", 3.3, 0.88, 5.5e-5)


def track(n: int = 3000, **other: object) -> DeviceRun:
    t = np.arange(n) * 1e-3
    parts: dict = {
        "begun": t,
        "took": np.full(n, 1e-5),
        "time": t,
        "place": np.zeros((n, 3)),
        "velocity": np.zeros((n, 3)),
        "buttons": np.zeros(n, np.int64),
        "ready": np.ones(n, np.bool_),
        "written": t,
        "force": np.zeros((n, 3)),
    }
    return DeviceRun(**{**parts, **other})


def finding(name: str, recorded: DeviceRun, info: DeviceInfo = INFO) -> Finding:
    return next(each for each in checkup.examine(recorded, info) if each.name == name)


def oscillation(n: int = 3000, step: float = 5.5e-5) -> np.ndarray:
    """Return positions of a stylus that oscillates most of the time, then rests."""
    z = np.round(0.02 * np.sin(np.minimum(np.arange(n), n - 1200) * 0.005) / step) * step
    return np.stack([z, z, z], axis=1)


def test_good_device_has_only_green_findings() -> None:
    findings = checkup.examine(track(place=oscillation()), INFO)
    assert {each.colour for each in findings} == {"green"}
    assert all(each.advice == "" for each in findings)


def test_loop_with_a_gap_is_yellow() -> None:
    late = np.arange(3000) * 1e-3
    late[1500:] += 0.006
    result = finding("loop", track(begun=late))
    assert result.colour == "yellow"
    assert result.figures["largest_ms"] == pytest.approx(7.0)
    assert result.figures["p50_ms"] == pytest.approx(1.0)


def test_position_updates_slower_than_the_loop_are_yellow() -> None:
    result = finding("position updates", track(time=np.arange(3000) // 2 * 2e-3))
    assert result.colour == "yellow"
    assert result.figures["rate_hz"] == pytest.approx(500, rel=0.01)


def test_slow_reads_are_yellow() -> None:
    assert finding("read duration", track(took=np.full(3000, 2e-3))).colour == "yellow"


def test_device_at_rest_that_returns_whole_numbers_is_examined() -> None:
    ms = 1_000_000
    here = [Reading(k * ms, 0, 0, 0, 0, 0, 0, buttons=0, ready=True) for k in range(3000)]
    rows = [(r.stamp_ns, r.stamp_ns + 1000, r, r.stamp_ns + 2000, (0.0, 0.0, 0.0)) for r in here]
    assert finding("resolution", track_of(rows)).found.startswith("not measured")


def test_resolution_is_judged_only_if_the_stylus_moves() -> None:
    assert finding("resolution", track()).colour == "yellow"
    result = finding("resolution", track(place=oscillation()))
    assert (result.colour, result.figures["smallest_m"]) == ("green", pytest.approx(5.5e-5))
    assert finding("resolution", track(place=oscillation(step=5e-4))).advice == "coarser than the device reports"


def test_noise_is_measured_in_the_quietest_second() -> None:
    rng = np.random.default_rng(1)
    place = oscillation()
    place[1800:] = 0.01 + 1e-5 * rng.standard_normal((1200, 3))
    result = finding("noise at rest", track(place=place))
    assert result.colour == "green"
    assert result.figures["z_m"] == pytest.approx(1e-5, rel=0.1)
    place[1800:] = 0.01 + 3e-4 * rng.standard_normal((1200, 3))
    assert finding("noise at rest", track(place=place)).colour == "yellow"


def test_pressed_buttons_are_listed_and_unready_device_is_yellow() -> None:
    buttons = np.zeros(3000, np.int64)
    buttons[5], buttons[9] = 1, 4
    assert finding("buttons", track(buttons=buttons)).found == "pressed: 0, 2"
    assert finding("ready for forces", track(ready=np.zeros(3000, np.bool_))).colour == "yellow"


def test_watching_writes_no_force() -> None:
    device = Puppet(Config(), AT_REST)
    device.open()
    recorded = watch(device, SimulatedTime(), 0.3)
    assert len(recorded.time) == 300
    assert device.forces == []


def test_virtual_device_moved_by_its_hand_passes_the_checkup() -> None:
    device = virtual(configured(held=True))
    device.command([Submovement("left", 1.5, 0.4, 0.03), Submovement("left", 2.5, 0.4, -0.03)])
    colours = {each.name: each.colour for each in checkup.examine(watch(device, SimulatedTime(), 4.0), device.info)}
    assert set(colours.values()) == {"green"}, colours


# --- pushes --------------------------------------------------------------------------------------------------------


def measured_pushes(level: float, **model: float) -> checkup.Pushes:
    device = virtual(configured(**model))
    track = Driver(device, SimulatedTime(), Safety(max_force=level)).drive(
        checkup.PUSHING, lambda t, _: checkup.push_force(level, t)
    )
    mechanics = Mechanics(mass=model["mass"], friction=model["friction"], identified="given")
    return checkup.pushes(track, device.info, mechanics)


@pytest.mark.parametrize(("resolution", "distance"), [(5.5e-5, 1.5 * 5.5e-5), (0.0, checkup.SMALLEST)])
def test_all_pushes_move_a_free_stylus_after_the_mechanical_delay(resolution: float, distance: float) -> None:
    found = measured_pushes(0.3, mass=0.1, friction=0.05, damping=0.1, resolution=resolution)
    assert (len(found.delays), found.tried) == (checkup.PULSES, checkup.PULSES)
    assert found.mechanical == pytest.approx((2 * distance * 0.1 / 0.25) ** 0.5)
    assert np.allclose(found.delays, found.mechanical, atol=3.1e-3)
    assert checkup.judge_pushes(found).colour == "green"


def test_pushes_held_by_friction_are_red() -> None:
    found = measured_pushes(0.2, mass=0.045, friction=0.26, damping=0.1)
    assert found.delays == ()
    assert checkup.judge_pushes(found).colour == "red"


def test_delayed_response_to_pushes_is_yellow() -> None:
    late = checkup.Pushes((0.03, 0.031, 0.029), 3, 0.008)
    assert checkup.judge_pushes(late).colour == "yellow"
    assert "identify" in checkup.judge_pushes(late._replace(mechanical=float("nan"))).found


def test_pushes_alternate_in_direction_and_end_at_zero() -> None:
    times = np.arange(0.0, checkup.PUSHING, 1e-3)
    heights = np.array([checkup.push_force(0.3, t)[2] for t in times])
    assert set(heights) == {0.0, 0.3, -0.3}
    assert heights.sum() == pytest.approx(0.0, abs=0.7)
    assert heights[0] == heights[-1] == 0.0
    assert np.count_nonzero(np.diff(heights) != 0.0) == 2 * checkup.PULSES
