"""The log port of a server without the rest, which feeds a real logger at any multiple of one dyad's rate.

Port, ring buffer, batches and sockets are those of the server. Each millisecond has the records that a server sends: a
tick, sometimes an event, clock probes and frames of two displays; a multiple of the rate has a multiple of each.
"""

import shutil
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from itertools import cycle
from pathlib import Path
from typing import Self

from netboard.base.clock import now_ns
from netboard.base.config import Config, resolve
from netboard.base.errors import NetboardError
from netboard.base.tick import TICK_NS, TICK_SECONDS
from netboard.benchmarks.recording.specimen import SESSION, movement
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Welcome
from netboard.network.protocol.messages import PROTOCOL_VERSION
from netboard.network.protocol.records import ClockRecord, EventRecord, FrameRecord, TickRecord
from netboard.network.transport import channels, sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.ports.log_port import LogPort
from netboard.nodes.server.session import FEED_TICKS
from netboard.recording.recovery.spill import Spill

START_SECONDS = 60.0
RING = 400_000
"""Records that the ring buffer holds [1]."""


def live_log(ticks: int) -> list[list[bytes]]:
    """Return the records of a session by millisecond: each tick, and the other records of that millisecond."""
    log = []
    for k, row in enumerate(movement(ticks)):
        records: list[TickRecord | EventRecord | ClockRecord | FrameRecord] = [TickRecord(row.tobytes())]
        if k % 500 == 0:
            records.append(EventRecord(k // 500, k, int(row["time_ns"]), "trial_started", {"trial": str(k)}))
        if k % 200 == 0:
            records.append(
                ClockRecord(k // 200, "agent.left", k, k + 10**9, k + 10**9, k + 3 * 10**5, 10**9, 9000, 0.1)
            )
        if k % 17 < 2:
            side = ("left", "right")[k % 17]
            records.append(FrameRecord(k // 17, side, k, k * 10**6, k * 10**6 + 7 * 10**6, 0))
        log.append([encode(record) for record in records])
    return log


class Feeder:
    """Feeds one logger process through a port."""

    def __init__(self, folder: Path, log: list[list[bytes]]) -> None:
        self.folder = folder
        self.ticks = 0
        self.behind_ns = 0
        self._log = cycle(log)
        self._stack = ExitStack()
        config = Config()
        self._config = replace(
            config,
            network=replace(config.network, port=free_port(), host="127.0.0.1", bind="127.0.0.1"),
            recording=replace(config.recording, directory=str(folder / "recordings")),
        )

    def __enter__(self) -> Self:
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        file = self.folder / "rig.toml"
        file.write_text(resolve(self._config), encoding="utf-8")
        context = self._stack.enter_context(sockets.open_context())
        endpoint = channels.addresses(self._config.network).listen(channels.LOG)
        welcome = Welcome(SESSION, PROTOCOL_VERSION, now_ns(), file.read_text(encoding="utf-8"))
        spill = Spill(self.folder / "feeder.spill", welcome, 0)
        self.port = LogPort(sockets.log_server(context, endpoint), welcome, RING, spill)
        command = [sys.executable, "-m", "netboard.services.cli", "logger", "--once", "-c", str(file)]
        with (self.folder / "logger.log").open("wb") as log:
            self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        return self

    def __exit__(self, *raised: object) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.port.close()
        self._stack.close()

    def wait_for_logger(self) -> None:
        """Wait until the logger has connected and asked for records."""
        end = now_ns() + round(START_SECONDS * 1e9)
        while not self.port.loggers:
            self.port.pump(now_ns())
            if self.process.poll() is not None or now_ns() > end:
                log = (self.folder / "logger.log").read_text(encoding="utf-8", errors="replace")
                raise NetboardError(f"the logger did not connect: {log.strip()[-200:]}")
            time.sleep(TICK_SECONDS)

    def feed(self, seconds: float, rate: int = 1, look: Callable[[], object] = lambda: None) -> None:
        """Send the records of a period as they become due, in portions as long as those of a server at this rate."""
        due, portion = now_ns(), max(1, FEED_TICKS // rate)
        for tick in range(round(seconds * 1e3)):
            due += TICK_NS
            time.sleep(max(0.0, (due - now_ns()) * 1e-9))
            self.behind_ns = max(self.behind_ns, now_ns() - due)
            for _ in range(rate):
                for record in next(self._log):
                    self.port.append(record)
            self.ticks += rate
            if tick % portion == 0:
                self.port.pump(now_ns())
            look()

    def end(self) -> None:
        """Announce the end of the log, and wait until the logger has finished its file."""
        self.port.end()
        end = now_ns() + round(START_SECONDS * 1e9)
        while self.process.poll() is None:
            self.port.pump(now_ns())
            if now_ns() > end:
                raise NetboardError("the logger did not finish")
            time.sleep(TICK_SECONDS)
