"""All processes of some dyads on this machine, with simulated participants.

A block with haptic feedback runs in every dyad. Between measurements the processes can be stopped (SIGSTOP), so that
they use no CPU while something else is measured. When they continue, the server detects the stall, pauses the trials
and resumes them as soon as all peers are there.
"""

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path

from netboard.base.clock import now_ns
from netboard.base.config import SIDES, Config, resolve
from netboard.base.errors import NetboardError
from netboard.benchmarks.harness.rig import ACTIVE, Rig, Route, add_dyad_keys
from netboard.benchmarks.loop.usage import Usage, read_usage
from netboard.network import keys
from netboard.network.protocol.control import Status
from netboard.network.transport.ports import free_port

TRIALS = 10_000
"""More trials than any benchmark reaches [1]."""

SETTLE_SECONDS = 2.0
"""Settling time after a block begins or resumes, in which agents adjust their phase and forces ramp up [s]."""

POLL_INTERVAL_S = 1.0
"""Interval at which the processes are checked during a measurement [s]."""


@dataclass(frozen=True)
class Period:
    """A period of a measurement, on the monotonic clock [ns], and the resource use of each process before and after."""

    start_ns: int
    end_ns: int
    before: dict[str, Usage]
    after: dict[str, Usage]


class Dyads(ExitStack):
    """The processes of some dyads on one server; leaving the context ends them.

    - `agent`: what the command of an agent begins with.
    """

    def __init__(self, configs: Sequence[Config], folder: Path, displays: int, agent: tuple[str, ...] = ()) -> None:
        super().__init__()
        self._rigs: list[Rig] = []
        for config in configs:
            (folder / config.session.dyad).mkdir(exist_ok=True)
            network = config.network
            routes = {f"{side} agent": Route(network.host, network.port, agent) for side in SIDES} if agent else {}
            self._rigs.append(self.enter_context(Rig(folder / config.session.dyad, config, routes=routes)))
        self.callback(self.resume)
        first, *others = self._rigs
        first.start("server", "server", *(word for rig in others for word in ("-c", str(rig.file))))
        for rig in self._rigs:
            rig.start("logger", "logger", "--once")
            rig.start_stations()
            for i in range(displays):
                station = SIDES[i % len(SIDES)]
                name = f"{station} display" + (f" again {i // 2}" if i >= len(SIDES) else "")
                rig.start(name, "display", "--station", station, "--offscreen")

    def wait_for_trials(self) -> None:
        """Wait until every dyad is in a trial and has settled."""

        def trial_runs(status: Status) -> bool:
            self.poll()
            return status.phase in ACTIVE

        for rig in self._rigs:
            rig.until(trial_runs)
        for rig in self._rigs:
            rig.disconnect()
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
        return {
            f"{name} {number}" if name != "server" and len(self._rigs) > 1 else name: read_usage(process.pid)
            for number, rig in enumerate(self._rigs, start=1)
            for name, process in rig.running.items()
        }

    def suspend(self) -> None:
        """Suspend all processes."""
        for rig in self._rigs:
            for name in rig.running:
                rig.suspend(name)

    def resume(self) -> None:
        """Resume all processes."""
        for rig in self._rigs:
            for name in rig.running:
                rig.resume(name)

    def finish(self) -> list[Path]:
        """End the sessions in order, and return their recordings, in the order of the dyads."""
        for rig in self._rigs:
            rig.ask_to_end()
        found = [rig.finished() for rig in self._rigs]
        if any(len(paths) != 1 for paths in found):
            raise NetboardError(f"expected one recording of each dyad, found {[len(paths) for paths in found]}")
        return [path for (path,) in found]

    def poll(self) -> None:
        """Check that the processes still run."""
        for rig in self._rigs:
            rig.require_running()


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
