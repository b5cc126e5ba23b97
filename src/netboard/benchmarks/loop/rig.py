"""All processes of some dyads on this machine, with simulated participants.

A block with haptic feedback runs in every dyad. Between measurements the processes can be stopped (SIGSTOP), so that
they use no CPU while something else is measured. When they continue, the server detects the stall, pauses the trials
and resumes them as soon as all peers are there.
"""

import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, resolve
from netboard.base.errors import NetboardError
from netboard.benchmarks.harness.dyad_keys import add_dyad_keys
from netboard.benchmarks.loop.usage import Usage, read_usage
from netboard.network import keys
from netboard.network.protocol.control import Status
from netboard.network.transport import sockets
from netboard.network.transport.ports import free_port
from netboard.nodes.operator.launcher import Launcher
from netboard.nodes.operator.operator import Operator
from netboard.stage.curtain import PHASE_NAMES
from netboard.task.trials.state_machine import is_active

TRIALS = 10_000
"""More trials than any benchmark reaches [1]."""

ANSWER_SECONDS = 0.2
START_SECONDS = 120.0
END_SECONDS = 60.0
SETTLE_SECONDS = 2.0
"""Settling time after a block begins or resumes, in which agents adjust their phase and forces ramp up [s]."""

POLL_INTERVAL_S = 1.0
"""Interval at which the processes are checked during a measurement [s]."""

ACTIVE = frozenset(name for phase, name in PHASE_NAMES.items() if is_active(phase))
"""Phases in which forces are rendered."""


@dataclass(frozen=True)
class Period:
    """A period of a measurement, on the monotonic clock [ns], and the resource use of each process before and after."""

    start_ns: int
    end_ns: int
    before: dict[str, Usage]
    after: dict[str, Usage]


class Rig:
    """The processes of some dyads; leaving the context ends them."""

    def __init__(self, configs: Sequence[Config], folder: Path, displays: int) -> None:
        self._folder = folder
        self._displays = displays
        self._launcher = Launcher(folder, {"QT_QPA_PLATFORM": "offscreen"})
        self._files = write_configs(configs, folder)
        self._configs = configs
        self._pids: dict[str, int] = {}

    def __enter__(self) -> Self:
        many = len(self._files) > 1
        self._start("server", "server", *(argument for file in self._files for argument in ("-c", str(file))))
        for number, file in enumerate(self._files, start=1):
            suffix = f" {number}" if many else ""
            self._start(f"logger{suffix}", "logger", "--once", "-c", str(file))
            for side in SIDES:
                self._start(f"{side} agent{suffix}", "agent", "--side", side, "-c", str(file))
            for i in range(self._displays):
                station = SIDES[i % len(SIDES)]
                name = f"{station} display{suffix}" + (f" again {i // 2}" if i >= len(SIDES) else "")
                self._start(name, "display", "--station", station, "--offscreen", "-c", str(file))
        return self

    def __exit__(self, *raised: object) -> None:
        self.resume()
        self._launcher.stop_all()

    def _start(self, name: str, *arguments: str) -> None:
        self._launcher.start(name, *arguments)
        self._pids[name] = self._launcher.process_id(name)

    def wait_for_trials(self) -> None:
        """Wait until every dyad is in a trial and has settled."""
        with sockets.open_context() as context:
            operators = [Operator(config.network, context) for config in self._configs]
            for operator in operators:
                await_status(self._launcher, operator, lambda status: status.phase in ACTIVE)
        time.sleep(SETTLE_SECONDS)

    def measure(self, seconds: float, tell: Callable[[float], object]) -> Period:
        """Let the processes run for a period, and return it."""
        before, start_ns = self.usage(), now_ns()
        while (done := (now_ns() - start_ns) * 1e-9) < seconds:
            tell(done / seconds)
            time.sleep(min(POLL_INTERVAL_S, seconds - done))
            self.poll()
        return Period(start_ns, now_ns(), before, self.usage())

    def usage(self) -> dict[str, Usage]:
        """Return the resource use of every process."""
        return {name: read_usage(pid) for name, pid in self._pids.items()}

    def suspend(self) -> None:
        """Suspend all processes."""
        self._signal(signal.SIGSTOP)

    def resume(self) -> None:
        """Resume all processes."""
        self._signal(signal.SIGCONT)

    def finish(self) -> list[Path]:
        """End the sessions in order, and return their recordings, in the order of the dyads."""
        with sockets.open_context() as context:
            operators = [Operator(config.network, context) for config in self._configs]
            for operator in operators:
                await_status(self._launcher, operator)
                operator.command("end")
            names = [name for name in self._pids if name.startswith(("server", "logger"))]
            for name in names:
                if trouble := self._launcher.wait(name, END_SECONDS):
                    raise NetboardError(trouble)
                del self._pids[name]
        found = [sorted(Path(config.recording.directory).glob("*.mcap")) for config in self._configs]
        if any(len(paths) != 1 for paths in found):
            raise NetboardError(f"expected one recording of each dyad, found {[len(paths) for paths in found]}")
        return [path for (path,) in found]

    def poll(self) -> None:
        """Check that the processes still run."""
        check_running(self._launcher)

    def _signal(self, number: signal.Signals) -> None:
        for pid in self._pids.values():
            with suppress(ProcessLookupError):  # `poll` reports a process that has ended
                os.kill(pid, number)


def check_running(launcher: Launcher) -> None:
    """Raise an error if a process has ended."""
    if (ended := launcher.ended()) is not None:
        raise NetboardError(str(ended))


def await_status(launcher: Launcher, operator: Operator, ready: Callable[[Status], bool] = lambda status: True) -> None:
    """Poll a server's status until it meets a condition, by default until the server answers."""
    until = time.monotonic() + START_SECONDS
    while (status := operator.ask(ANSWER_SECONDS)) is None or not ready(status):
        check_running(launcher)
        if time.monotonic() > until:
            state = operator.status.notice or operator.status.phase if operator.status else "the server is silent"
            raise NetboardError(f"waited {START_SECONDS:.0f} s in vain: {state}")
        time.sleep(ANSWER_SECONDS)


def dyad_configs(config: Config, folder: Path, count: int) -> list[Config]:
    """Return configurations for some dyads on this machine, each with its port and its folder of recordings."""
    ports: set[int] = set()
    while len(ports) < count:
        ports.add(free_port())
    key_folder = folder / "keys"
    network = replace(config.network, host="127.0.0.1", bind="127.0.0.1", keys=str(key_folder))
    if keys.encrypted(network) and not key_folder.exists():
        keys.init(key_folder)
        add_dyad_keys(key_folder, key_folder)
    return [
        replace(
            config,
            session=replace(config.session, dyad=f"D{number:02d}"),
            block=replace(config.block, trials=TRIALS, seed=config.block.seed + number),
            network=replace(network, port=port),
            recording=replace(config.recording, directory=str(folder / f"dyad-{number:02d}")),
        )
        for number, port in enumerate(sorted(ports), start=1)
    ]


def write_configs(configs: Sequence[Config], folder: Path) -> list[Path]:
    """Write each configuration into a file with the name of its dyad."""
    files = [folder / f"{config.session.dyad}.toml" for config in configs]
    for file, config in zip(files, configs, strict=True):
        file.write_text(resolve(config), encoding="utf-8")
    return files
