"""``netboard bench loop`` and ``netboard bench soak``: latency and jitter of real processes on this machine.

Only the participants are simulated: server, agents, loggers and displays are the processes that a lab runs, at their
real rates. Other load on the machine affects the results; it is noted.
"""

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal

from netboard.base.config import Config
from netboard.base.errors import ConfigError, NetboardError
from netboard.benchmarks.harness.results import Folder, Part, new_folder
from netboard.benchmarks.harness.running import Tell, run
from netboard.benchmarks.loop.loop import (
    costs_part,
    latency_part,
    lateness_part,
    loop_series,
    measure_loop,
    ratios_part,
)
from netboard.benchmarks.loop.scale import Crowd, measure_scale, measure_waiting, scale_part, waiting_part
from netboard.benchmarks.loop.skips import measure_skips, skips_part, tick_part
from netboard.benchmarks.loop.soak import measure_soak, memory_part, minutes_part, records_part
from netboard.benchmarks.loop.spreads import draw_histograms, histogram_part
from netboard.benchmarks.loop.usage import Costs, add_costs
from netboard.stage.stage import make_stage

SECONDS, QUICK_SECONDS = 60.0, 8.0
"""Default measurement time of netboard, the echo and the timer, each [s]."""

TURN_SECONDS, QUICK_TURN_SECONDS = 6.0, 2.0
"""Approximate length of a turn [s]."""

MINUTES, QUICK_MINUTES = 30.0, 0.5
"""Default duration of a soak test [min]."""

MAX_DYADS = 256

Transport = Literal["tcp", "ipc"]


@dataclass(frozen=True)
class Setting:
    """The setting in which netboard is measured."""

    transport: Transport = "tcp"
    curve: bool = False
    real_time: bool = True
    displays: int = 0
    quick: bool = False

    @property
    def config(self) -> Config:
        """Return the configuration for this setting."""
        plain = Config()
        return replace(
            plain,
            network=replace(plain.network, transport=self.transport, curve="on" if self.curve else "off"),
            realtime=replace(plain.realtime, scheduling=self.real_time),
        )

    def __str__(self) -> str:
        keys, scheduling = "keys" if self.curve else "no keys", "real-time" if self.real_time else "usual"
        return f"{self.transport}, {keys}, {scheduling} scheduling, displays: {self.displays}"


def read_dyads(words: str | None) -> tuple[int, ...]:
    """Parse the numbers of dyads, as in ``1,2,4``."""
    try:
        numbers = tuple(int(word) for word in words.split(",")) if words else ()
    except ValueError:
        numbers = (0,)
    if not all(0 < number <= MAX_DYADS for number in numbers):
        raise ConfigError(f"--dyads: found {words}, expected numbers from 1 to {MAX_DYADS} with commas between")
    return numbers


def loop(
    setting: Setting,
    seconds: float | None,
    dyads: Sequence[int],
    output: Path | None,
    json: Path | None,
    *,
    skips: bool,
    force: bool,
) -> int:
    """Run ``netboard bench loop``; the exit code is 0, also if claims fail, since that is a result.

    - `seconds`: duration of each measurement; None for the default [s].
    - `dyads`: numbers of dyads for which a server is measured; empty to skip that part [1].
    """
    seconds = seconds or (QUICK_SECONDS if setting.quick else SECONDS)
    rounds = max(1, round(seconds / (QUICK_TURN_SECONDS if setting.quick else TURN_SECONDS)))
    about = {"seconds": seconds, "rounds": rounds, "dyads": list(dyads)}

    def study(place: Folder, tell: Tell) -> Iterator[Part]:
        scratch = place.path / "processes"
        found = measure_loop(setting.config, scratch, setting.displays, seconds, rounds, tell)
        series = loop_series(found)
        yield ratios_part(found)
        yield latency_part(found, real_time=setting.real_time)
        yield lateness_part(found)
        yield costs_part(found.costs)
        yield histogram_part(series[0] | series[1])
        if dyads or skips:
            with Crowd(scratch) as crowd:
                yield from _crowded(crowd, setting.config, dyads, seconds / rounds, tell, skips=skips)
        place.save("loop", lambda: draw_histograms(series, f"Stylus to force: {setting}"))

    _run("loop", setting, about, study, output, json, force=force)
    return 0


def _crowded(
    crowd: Crowd, config: Config, dyads: Sequence[int], seconds: float, tell: Tell, *, skips: bool
) -> Iterator[Part]:
    """Measure a server with lightweight peers."""
    if dyads:
        found = measure_scale(config, crowd, dyads, seconds, tell)
        yield scale_part(found)
        most = max(found)
        yield waiting_part(most, measure_waiting(config, crowd, most, seconds, tell))
    if skips:
        yield skips_part(measure_skips(config, crowd, seconds, tell))
        yield tick_part(config)


def soak(
    setting: Setting, minutes: float | None, dyads: int, output: Path | None, json: Path | None, *, force: bool
) -> int:
    """Run ``netboard bench soak``."""
    minutes = minutes or (QUICK_MINUTES if setting.quick else MINUTES)

    def study(place: Folder, tell: Tell) -> Iterator[Part]:
        scratch = place.path / "processes"
        found = measure_soak(setting.config, scratch, dyads, setting.displays, 60 * minutes, tell)
        yield records_part(found.kept)
        yield memory_part(found.samples)
        yield minutes_part(found.kept)
        costs: Costs = {}
        add_costs(costs, found.samples[0], found.samples[-1])
        yield costs_part(costs)

    kept = _run("soak", setting, {"minutes": minutes, "dyads": dyads}, study, output, json, force=force)["records"]
    return 0 if kept.holds else 1


def _run(
    name: str,
    setting: Setting,
    about: Mapping[str, Any],
    study: Callable[[Folder, Tell], Iterator[Part]],
    output: Path | None,
    json: Path | None,
    *,
    force: bool,
) -> dict[str, Part]:
    """Run a study of real processes; their recordings and logs are removed if it succeeds."""
    if not Path("/proc/self/task").exists():
        raise NetboardError("what processes use is read from /proc, which this system does not have")
    folder = Folder(output or new_folder(f"bench-{name}"), force=force)
    scratch = folder.path / "processes"
    shutil.rmtree(scratch, ignore_errors=True)
    scratch.mkdir()
    parts: dict[str, Part] = {}

    def collected(tell: Tell) -> Iterator[Part]:
        tell("getting the kernels ready", 0.0)
        make_stage(setting.config).warm()
        for part in study(folder, tell):
            parts[part.name] = part
            yield part

    run(folder, {"study": name, **asdict(setting), **about}, collected, json, lines=[str(setting)])
    shutil.rmtree(scratch)
    return parts
