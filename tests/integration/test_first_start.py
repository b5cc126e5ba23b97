"""The first start after an installation: what it compiles and says; a prepared session compiles nothing."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from libhd import fake_library
from netboard.nodes.launching.kernels import EXPECTED
from netboard.services.guard import KERNELS

pytestmark = [
    pytest.mark.slow,
    pytest.mark.integration,
    pytest.mark.skipif("NUMBA_DISABLE_JIT" in os.environ, reason="nothing is compiled"),
]

TIMEOUT_S = 900.0

AGENT_THAT_STOPS_AT_ONCE = """
import sys
from netboard.base.config import parse
from netboard.devices.contract import registry
from netboard.network.transport import sockets
from netboard.nodes.agent.agent import AgentNode

config = parse("", overrides=sys.argv[1:])
with sockets.open_context() as context, registry.make("left", config) as device:
    AgentNode(config, "left", device, context).run(lambda: True)
"""


def run(folder: Path, *words: str) -> str:
    """Return what a command prints that has its own cache."""
    return process(folder, "-m", "netboard.services.cli", *words)


def process(folder: Path, *words: str) -> str:
    """Return what Python prints that has its own cache."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, *words]
    done = subprocess.run(
        command, env=environment, cwd=folder, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout + done.stderr


def kernels(folder: Path) -> set[str]:
    return {path.name for path in (folder / "cache").rglob("*.nbc")}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder whose cache is empty before the first test."""
    return tmp_path_factory.mktemp("first_start")


def require_no_compilation(folder: Path, found: set[str]) -> None:
    """Require that the processes of sessions have compiled nothing, nor has a demo, but for what reads recordings."""
    reading = ("netboard.recording.", "netboard.task.trials.quality.")  # which the demo does after the session
    assert [name for name in kernels(folder) - found if not name.startswith(reading)] == []
    logs = "".join(path.read_text(encoding="utf-8") for path in folder.rglob("*.log"))
    assert logs
    assert "compiling" not in logs


def test_prepared_session_compiles_nothing_more(folder: Path) -> None:
    said = run(folder, "up", "--prepare")
    found = kernels(folder)
    assert len(found) == pytest.approx(EXPECTED.kernels, rel=0.15), "as many as the estimate of the time left assumes"
    assert sum(one.kernels for one in KERNELS.values()) == pytest.approx(EXPECTED.kernels, rel=0.15)
    assert "compiling kernels for this machine, once after an installation or an update: " in said
    assert f"kernels        {len(found)} compiled in " in said
    assert run(folder, "up", "--prepare") == "kernels        ready\n"
    run(folder, "demo", "--no-displays", "--trials", "1")
    require_no_compilation(folder, found)


def test_prepared_session_with_a_robot_partner_compiles_nothing_more(folder: Path) -> None:
    partner = ("--set", "block.right=learned")
    run(folder, "up", "--prepare", *partner)
    found = kernels(folder)
    assert run(folder, "up", "--prepare", *partner) == "kernels        ready\n"
    run(folder, "demo", "--no-displays", "--trials", "1", "--partner", "learned")
    require_no_compilation(folder, found)


def test_prepared_session_with_a_touch_compiles_nothing_more(folder: Path) -> None:
    touch = ("agents.left.device=openhaptics", f"agents.left.options.library={fake_library()}")
    overrides = [word for one in touch for word in ("--set", one)]
    run(folder, "up", "--prepare", *overrides)
    found = kernels(folder)
    process(folder, "-c", AGENT_THAT_STOPS_AT_ONCE, *touch)
    assert kernels(folder) == found
