"""The doctor's examination and its report, which the logger adds to every recording that it makes here.

A report names no person and no machine: it only describes the machine.
"""

import json
import os
import platform
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path

from netboard.base.config import Config
from netboard.base.errors import NetboardError, writing
from netboard.base.files.new import new_file
from netboard.base.finding import Colour, Finding
from netboard.base.process.realtime import OFF, OK, cpus_for
from netboard.base.process.workers import usable_cpus
from netboard.base.system.c_library import load_average
from netboard.devices.setup import listing, usb
from netboard.nodes.doctor import disk, exchange, loopback, network, prediction, system, timing

Progress = Callable[[float], None]
Step = Callable[[Progress], list[Finding]]

FORMAT = 1
"""Version of the report's layout [1]."""


@dataclass(frozen=True)
class Effort:
    """How thorough an examination is."""

    timer_seconds: float  # duration of each of the two timer tests, and of the exchange [s]
    exchanges: int
    chunks: int
    pulses: int


THOROUGH = Effort(10.0, 1000, 200, 500)
QUICK = Effort(1.0, 100, 20, 50)


@dataclass(frozen=True)
class DoctorReport:
    """All findings, and a description of the machine."""

    utc: str
    machine: dict[str, str]
    findings: tuple[Finding, ...]

    @property
    def fit(self) -> bool:
        """Whether nothing is red."""
        return all(finding.colour != "red" for finding in self.findings)

    @property
    def summary(self) -> str:
        """The report in one line."""
        count = Counter(finding.colour for finding in self.findings)
        late = [finding.figures["p999_us"] for finding in self.findings if finding.name == timing.TIMER]
        counts = f"{count['green']} green, {count['yellow']} yellow, {count['red']} red"
        return counts + "".join(f"; timer p99.9 {us:.0f} us" for us in late)

    def text(self) -> str:
        """Return the report as JSON."""
        head = {"format": FORMAT, "summary": self.summary, "utc": self.utc, "machine": self.machine}
        return json.dumps({**head, "findings": [asdict(finding) for finding in self.findings]}, indent=2)

    def save(self, path: Path) -> None:
        """Write the report to a file, in place of an older one."""
        with writing(path, NetboardError):
            path.parent.mkdir(parents=True, exist_ok=True)
        with new_file(path, force=True) as part:
            part.write_text(self.text() + "\n", encoding="utf-8")


def steps(config: Config, effort: Effort) -> dict[str, Step]:
    """Return the examination's steps in order; each reports its progress, up to 1."""
    missing: Colour = "red" if network.is_alone(config.network) else "yellow"  # a device may be at another machine
    return {
        "software": lambda progress: [system.versions(), system.kernels()],
        "timer": lambda progress: list(_timers(config, effort, progress)),
        "operating system": lambda progress: [
            system.throttle(),
            system.governor(),
            system.preemption(),
            system.clock_source(),
            system.virtual_machine(),
            system.cores(usable_cpus()),
            system.isolation(cpus_for("server", config.realtime), usable_cpus()),
        ],
        "clock": lambda progress: [network.clock_bound(config.network, effort.exchanges, progress)],
        "network": lambda progress: [
            network.ports(config.network),
            network.secrets(config.network),
            network.card(config.network),
        ],
        "disk": lambda progress: [disk.space(config.recording), disk.speed(config.recording, effort.chunks, progress)],
        "windows": lambda progress: list(system.windows()),
        "devices": lambda progress: [usb.devices(), *listing.configured(config, missing)],
        "triggers": lambda progress: list(loopback.examine(config.triggers, effort.pulses, missing, progress)),
    }


def _timers(config: Config, effort: Effort, progress: Progress) -> Iterator[Finding]:
    """Test a loop with the server's settings and one with none; report which were granted, and predict the loop."""
    wanted = config.realtime
    real = timing.measure(wanted, effort.timer_seconds, lambda done: progress(done / 3))
    yield system.scheduling(real.granted["scheduling"])
    yield system.memory(real.granted["memory"])
    yield system.core_sleep(real.granted["core_sleep"] == OK)
    if real.granted["cpus"] != OFF:
        yield system.cpus(cpus_for("server", wanted), real.granted["cpus"])
    yield timing.verdict(real)
    plain = replace(wanted, scheduling=False, lock_memory=False)
    usual = timing.measure(plain, effort.timer_seconds, lambda done: progress((1 + done) / 3))
    yield timing.comparison(usual)
    times = exchange.measure(wanted, effort.timer_seconds, lambda done: progress((2 + done) / 3))
    yield prediction.finding(prediction.predict(times, real.missed, real.ticks))


def examine(config: Config, effort: Effort, follow: Callable[[str, float], None]) -> DoctorReport:
    """Run all steps. ``follow``: gets the name of the current step, and its progress up to 1."""
    findings: list[Finding] = []
    for what, step in steps(config, effort).items():
        follow(what, 0.0)
        findings += step(lambda done, what=what: follow(what, done))  # type: ignore[misc]
        follow(what, 1.0)
    return DoctorReport(
        datetime.now(UTC).isoformat(timespec="seconds"), machine(), tuple(prediction.with_limits(findings))
    )


def machine() -> dict[str, str]:
    """Describe this machine without its name."""
    load = f"{load_average():.2f}"
    return {"platform": platform.platform(), "cpus": str(os.cpu_count()), "load": load}
