"""Real sessions in which all peers connect, leave and return: `netboard check` finds no damage."""

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path

import pytest
from test_authentication import rig_with_keys

from netboard.benchmarks.harness.rig import Rig
from netboard.network.protocol.records import kind_of_peer
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.checking import check
from netboard.recording.integrity.severity import Severity
from netboard.recording.recovery.spilled import recover_any

pytestmark = [pytest.mark.integration, pytest.mark.slow, pytest.mark.timeout(300)]

QUICK_TRIALS = (
    "task.level_time=0.05",
    "task.level_angle_deg=5.0",
    "task.level_rate_deg_s=30.0",
    "block.trials=50",
    "network.sample_timeout_ms=1000",
)
"""The ball is released at once, and a slow machine does not pause the trial."""


@pytest.fixture
def open_rig(tmp_path: Path) -> Iterator[Callable[..., Rig]]:
    with ExitStack() as stack:
        yield lambda *settings: stack.enter_context(Rig(tmp_path, (*QUICK_TRIALS, *settings)))


def damage_in(rig: Rig) -> dict[str, list[str]]:
    """The damage found in each recording of a rig, after recovery of interrupted recordings."""
    folder = Path(rig.config.recording.directory)
    for part in folder.glob("*.part"):
        recover_any(part)
    found = {path.name: check(path, replay=True).findings for path in folder.glob("*.mcap")}
    assert found
    return {name: [f.text for f in findings if f.severity == Severity.DAMAGE] for name, findings in found.items()}


def peers_of(paths: Sequence[Path]) -> set[str]:
    """Names of the connections with recorded clock probes."""
    peers: set[str] = set()
    for path in paths:
        with Recording(path) as recording:
            peers |= {probe.peer for probe in recording.clocks()}
    return peers


def advance(rig: Rig, ticks: int) -> None:
    """Wait for a number of ticks in which a trial runs at the start and the end."""
    now = rig.until(lambda status: status.phase == "running").tick
    rig.until(lambda status: status.tick > now + ticks and status.phase == "running")


def command_until_accepted(rig: Rig, command: str) -> None:
    """Repeat a command until it is accepted, because the trial may just be paused or over."""
    rig.until(lambda status: rig.operator.do(command).accepted)


@pytest.mark.sampled(1, of="whole sessions")
def test_duplicate_and_reconnecting_peers_leave_undamaged_recordings(open_rig: Callable[..., Rig]) -> None:
    rig = open_rig()
    rig.start_all(displays=True)
    rig.start("second left display", "display", "--station", "left")
    rig.start("second console", "console", "--offscreen")
    both = ["console", "console", "display.left", "display.left", "display.right"]
    rig.until(lambda status: sorted(link.peer for link in status.links if link.peer[:3] in {"con", "dis"}) == both)
    advance(rig, 4000)
    rig.stop("right display", signal.SIGTERM)
    rig.start("right display", "display", "--station", "right")
    command_until_accepted(rig, "pause")
    command_until_accepted(rig, "resume")
    advance(rig, 2000)
    command_until_accepted(rig, "abort")
    rig.kill("left agent")
    rig.until(lambda status: status.phase == "paused")
    rig.start_agent("left")
    advance(rig, 2000)
    rig.kill("logger")
    rig.start("logger", "logger", "--once")
    rig.until(lambda status: any("part2" in file and size > 0 for file, _, size, _ in status.recordings))
    advance(rig, 2000)
    rig.finish()
    damage = damage_in(rig)
    assert len(damage) == 2
    assert all(not found for found in damage.values()), damage
    peers = peers_of(rig.recordings())
    assert {"display.left", "display.left#2", "display.right#2", "console#2", "agent.left#2", "logger#2"} <= peers
    assert {kind_of_peer(peer) for peer in peers} >= {"agent.right", "console"}


CONFIGURATIONS = {
    "forces computed at both ends": ("physics.coupling_at=both",),
    "a simulated partner": ("block.right=robot",),
    "one hand": ("block.right=still", "block.force=none"),
}


@pytest.mark.parametrize("settings", CONFIGURATIONS.values(), ids=CONFIGURATIONS)
@pytest.mark.sampled(1, of="whole sessions")
def test_other_configurations_stopped_in_a_trial_leave_undamaged_recordings(
    open_rig: Callable[..., Rig], settings: tuple[str, ...]
) -> None:
    rig = open_rig(*settings)
    rig.start_all()
    rig.until(lambda status: status.phase == "running")
    advance(rig, 1000)
    rig.finish()
    damage = damage_in(rig)
    assert all(not found for found in damage.values()), damage


@pytest.mark.sampled(1, of="whole sessions")
def test_session_with_keys_leaves_undamaged_recordings(tmp_path: Path) -> None:
    with rig_with_keys(tmp_path) as rig:
        rig.start_all(displays=True)
        rig.until(lambda status: status.phase == "running")
        advance(rig, 2000)
        rig.finish()
        damage = damage_in(rig)
        assert all(not found for found in damage.values()), damage
        assert {"display.left", "display.right", "console"} <= peers_of(rig.recordings())
