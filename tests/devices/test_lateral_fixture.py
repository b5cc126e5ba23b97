"""The lateral fixture."""

from hypothesis import given
from hypothesis import strategies as st

from lateral import lateral_force
from netboard.base.config import Config
from netboard.base.tables.rig import Fixture
from netboard.devices.contract.device import Reading
from netboard.devices.simulated.virtual import VirtualTouch

number = st.floats(-0.1, 0.1)


def reading(x: float, y: float, vx: float = 0.0, vy: float = 0.0) -> Reading:
    return Reading(0, x, y, 0.05, vx, vy, 0.3, 0, True)


def test_default_stiffness_is_that_of_the_paper() -> None:
    assert lateral_force(reading(0.001, -0.002), Fixture()) == (-0.4, 0.8)


@given(number, number, number, number)
def test_fixture_pulls_to_the_line_and_dissipates_energy(x: float, y: float, vx: float, vy: float) -> None:
    fx, fy = lateral_force(reading(x, y), Fixture())
    assert fx * x <= 0
    assert fy * y <= 0
    dx, dy = lateral_force(reading(0.0, 0.0, vx, vy), Fixture())
    assert dx * vx + dy * vy <= 0


def test_fixture_brings_a_hand_closer_to_the_line() -> None:
    config = Config()
    device = VirtualTouch("left", config)
    device.open()
    start = device.read(0)
    for k in range(1, 1000):
        now = device.read(k * 1_000_000)
        device.write(*lateral_force(now, config.fixture), 0.0)
    offset = (start.x**2 + start.y**2) ** 0.5
    assert offset > 1e-4
    assert (now.x**2 + now.y**2) ** 0.5 < offset
    assert (now.vx, now.vy) == (0.0, 0.0)
