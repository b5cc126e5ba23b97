"""Rehearsal of blocks: printed table or JSON output, with or without recordings."""

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest

from netboard.base.config import Config
from netboard.base.errors import NetboardError
from netboard.nodes.rehearsal import session as rehearsal
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording


def blocks(trials: int = 1) -> list[Config]:
    default = Config()
    dyadic = replace(default.block, trials=trials, number=1, blocks=2)
    bimanual = replace(dyadic, number=2, configuration="bimanual", force="none", catch=(1, 9), label="alone")
    return [replace(default, block=block) for block in (dyadic, bimanual)]


@pytest.mark.slow
def test_rehearsal_prints_a_table_of_block_results(capsys: pytest.CaptureFixture[str]) -> None:
    assert rehearsal.rehearse_blocks(blocks(), 1, 1, folder=None) == 0
    captured = capsys.readouterr().out
    assert "alone" in captured
    assert "2 blocks, 2 successful trials" in captured
    assert "x real time" in captured


@pytest.mark.slow
def test_rehearsal_writes_verifiable_recordings_listed_in_json(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert rehearsal.rehearse_blocks(blocks(), 1, 1, folder=tmp_path / "new", as_json=True) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["ticks"] == sum(block["ticks"] for block in report["blocks"])
    assert report["real_time_factor"] > 0
    for block in report["blocks"]:
        with Recording(Path(block["recording"])) as recording:
            assert verify_recording(recording).checked == block["ticks"]
    assert len(list((tmp_path / "new").iterdir())) == 2
    with pytest.raises(NetboardError, match="block01"):
        rehearsal.rehearse_blocks(blocks(), 1, 1, folder=tmp_path / "new")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="finds the worker in /proc")
def test_interrupt_while_a_worker_starts_is_no_traceback(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "netboard.services.cli", "session", "rehearse", "paper", "--blocks", "2"]
    with subprocess.Popen(
        [*command, "--workers", "2", "--output", str(tmp_path)], start_new_session=True, stderr=subprocess.PIPE
    ) as started:
        while started.poll() is None and not any(
            b"spawn_main" in child.read_bytes()
            for place in Path(f"/proc/{started.pid}/task/{started.pid}/children").read_text().split()
            if (child := Path(f"/proc/{place}/cmdline")).exists()
        ):
            time.sleep(0.01)
        time.sleep(0.2)  # into the worker's imports, which nothing reports
        os.killpg(started.pid, signal.SIGINT)
        assert started.stderr is not None
        said = [line for line in started.stderr.read().splitlines() if not line.startswith(b"compiling kernels")]
        assert said == [b"netboard: interrupted"]
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="Ctrl-C reaches a process group on POSIX only")
@pytest.mark.parametrize("workers", ["1", "2"])
@pytest.mark.parametrize(("kill", "number"), [("killpg", signal.SIGINT), ("kill", signal.SIGTERM)])
def test_stopped_rehearsal_ends_all_workers_and_leaves_nothing(
    kill: str, number: int, workers: str, tmp_path: Path
) -> None:
    rehearsal.rehearse_blocks(blocks()[:1], 1, 1, folder=None)  # an interruption may be lost while code is compiled
    command = [sys.executable, "-m", "netboard.services.cli", "session", "rehearse", "paper", "--real-time"]
    with subprocess.Popen(
        [*command, "--workers", workers, "--output", str(tmp_path)],
        start_new_session=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as started:
        try:
            until = time.monotonic() + 300
            while len(list(tmp_path.iterdir())) < int(workers) and time.monotonic() < until:
                time.sleep(0.1)
            getattr(os, kill)(started.pid, number)
            assert started.wait(60) == 1
        finally:
            with suppress(ProcessLookupError):
                os.killpg(started.pid, signal.SIGKILL)
    assert not list(tmp_path.iterdir())
