"""Implementation of ``netboard devices``: one device of the rig, without a server."""

import json
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from rich.live import Live

from netboard.base import clock
from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError, DeviceError, NetboardError
from netboard.base.files.new import free_backup
from netboard.base.finding import Finding
from netboard.base.process.realtime import Priority, cpus_for, prepare, steady_loop
from netboard.base.process.stopping import Stopping, interrupted_by_stop_signals, no_terminal_suspension
from netboard.base.terminal.bars import progress_bars
from netboard.base.terminal.output import plain_console
from netboard.devices.contract import profile, registry
from netboard.devices.contract.device import Box, Device, Reading
from netboard.devices.contract.profile import Identity, Mechanics, Placement, Profile
from netboard.devices.setup import calibration, checkup, excitation, listing, usb, words
from netboard.devices.setup.identification import Identified
from netboard.devices.setup.loop import DeviceRun, Driver, LoopClock, RealTime, watch

console = plain_console()

CONSENT = "the motors may move the stylus"
"""Confirmation that an operator types before a device is moved."""

MAX_UNCERTAINTY = 0.5
"""Largest half width of the mass's confidence interval, relative to the mass, with which it is saved [1]."""

WARM_UP = 0.1
"""Duration of the first readings, which are not counted [s]."""

HOLD = 1.0
"""Time for which a stylus is held still to take its position [s]."""

SETTLE = 5.0
"""Time to move to the next position when nobody is asked [s]."""

TEXT_SECONDS = 0.1
"""Interval between two printed readings [s]."""

MONITOR_SECONDS = 0.005
"""Interval between two readings of a device that is printed [s]."""

Ask = Callable[[str], str]

Show = Callable[[Callable[[], Reading], str, Callable[[], bool]], object]
"""Shows the readings of a device under a title until it is over."""


def show_list(config: Config, *, as_json: bool, root: Path = usb.ROOT) -> int:
    """Show devices and backends; return 1 if a connected device may not be opened."""
    found = listing.listing(config, root)
    if as_json:
        _print_json(words.plain_listing(found))
    else:
        console.print(words.listing_tables(found))
    return 1 if any(each.shut for each in found.devices) else 0


def examine(
    config: Config,
    side: Side,
    *,
    seconds: float,
    force: float,
    yes: bool,
    as_json: bool,
    loop_clock: LoopClock | None = None,
) -> int:
    """Examine a device, without force unless one is given; return 1 if anything is red."""
    force = min(force, config.safety.max_force)
    if force:
        ask_consent(f"{checkup.PULSES} short pushes of {force:g} N, up and down", yes, input)
    with opened(config, side, loop_clock is None) as device, _bar(as_json) as progress:
        info, ticks = device.info, loop_clock or RealTime()
        watch(device, ticks, WARM_UP)
        findings = list(checkup.examine(watch(device, ticks, seconds, progress("reading")), info))
        if force:
            limits = replace(config.safety, max_force=force, arm_gate=min(force, config.safety.arm_gate))
            driver = Driver(device, ticks, limits)
            known = device.profile.mechanics if device.profile else None
            try:
                track = driver.drive(checkup.PUSHING, lambda t, _: checkup.push_force(force, t), progress("pushing"))
                findings.append(checkup.judge_pushes(checkup.pushes(track, info, known)))
            except DeviceError as error:  # what was measured before is shown nevertheless
                findings.append(Finding(checkup.PUSHED, "red", str(error)))
    if as_json:
        _print_json({"model": info.model, "serial": info.serial, "findings": [asdict(each) for each in findings]})
    else:
        console.print(words.findings_table(f"{info.model} {info.serial} ({side})", findings))
    return 1 if any(each.colour == "red" for each in findings) else 0


def identify(
    config: Config,
    side: Side,
    *,
    held: bool,
    yes: bool,
    replace_it: bool,
    as_json: bool,
    chirp: excitation.Chirp | None = None,
    loop_clock: LoopClock | None = None,
) -> int:
    """Identify a device's mechanics, and write them to its profile unless a hand held it."""
    chirp = chirp or excitation.Chirp()
    limits = excitation.limits_of(chirp, config.safety)
    what = "held loosely" if held else "with no hand on it, in the middle of its workspace"
    ask_consent(
        f"the stylus, {what}, up and down for {chirp.seconds:g} s with at most {limits.max_force:g} N", yes, input
    )
    with opened(config, side, loop_clock is None) as device, _bar(as_json) as progress:
        info, known, ticks = device.info, device.profile, loop_clock or RealTime()
        watch(device, ticks, WARM_UP)
        track = excitation.run(device, ticks, chirp, limits, progress("moving"))
    found = excitation.identified(track, held)
    if as_json:
        _print_json(words.plain_identified(info, found))
    else:
        whose = "hand and device" if held else "device"
        console.print(words.identified_table(f"{info.model} {info.serial} ({side}): the {whose}", found))
    if not held:
        mass, half_width = found.mass
        if half_width > MAX_UNCERTAINTY * mass:
            raise NetboardError(
                f"the mass could not be identified ({mass:.3g} +- {half_width:.2g} kg), and nothing was saved: was a "
                "hand on the stylus (--held), or did it touch something?"
            )
        known = known or Profile(Identity(info.model, info.serial))
        _save(config, replace(known, mechanics=mechanics_of(found, chirp)), replace_it, as_json)
    return 0


def mechanics_of(found: Identified, chirp: excitation.Chirp) -> Mechanics:
    """Return the mechanics for a profile."""
    how = f"{now_in_words()}, by a chirp of {chirp.seconds:g} s; misfit {found.misfit * 1e6:.0f} um"
    return Mechanics(*found.mass, *found.damping, *found.friction, identified=how)


def monitor(config: Config, side: Side, seconds: float | None, show: Show) -> None:
    """Show a device's readings until the duration is over [s] or the process is asked to end."""
    with Stopping() as stopping, registry.make(side, config) as device:
        until = None if seconds is None else clock.now_ns() + round(seconds * 1e9)
        show(
            lambda: device.read(clock.now_ns()),
            f"{device.info.model} {device.info.serial} ({side})",
            lambda: stopping() or (until is not None and clock.now_ns() >= until),
        )


def print_readings(read: Callable[[], Reading], title: str, over: Callable[[], bool]) -> None:
    """Print the newest reading in place until it is over."""
    with Live(words.reading_table(title, read()), console=console, auto_refresh=False) as live:
        shown = time.monotonic()
        while not over():
            reading = read()
            if time.monotonic() - shown >= TEXT_SECONDS:
                shown = time.monotonic()
                live.update(words.reading_table(title, reading), refresh=True)
            time.sleep(MONITOR_SECONDS)


def calibrate(
    config: Config,
    side: Side,
    *,
    zero_only: bool,
    yes: bool,
    given: Mapping[str, str],
    replace_it: bool,
    loop_clock: LoopClock | None = None,
    ask: Ask = input,
) -> int:
    """Find zero, workspace and scale of a device with an operator's help, and write them to its profile."""
    with opened(config, side, loop_clock is None and not given, restricted=False) as device:
        info, ticks = device.info, loop_clock or RealTime()
        if device.in_scene:
            raise NetboardError(f"the {info.model} needs no calibration: its positions are in the frame of the scene")
        known = device.profile or Profile(Identity(info.model, info.serial))
        if given:
            place = calibration.with_values(known.placement, given, f"{now_in_words()}, values given by hand")
        else:
            watch(device, ticks, WARM_UP)
            place = _measured(device, ticks, known.placement, config, None if yes else ask, zero_only=zero_only)
    console.print(words.placement_table(f"{info.model} {info.serial} ({side})", place))
    if place.scale != 1.0:
        console.print(f"at the device the virtual coupling is {place.scale:.2f} times as stiff as in the scene")
    reach, needed = calibration.reach(place, info.workspace), config.task.stylus_range
    if reach < needed - 1e-9:
        console.print(
            f"the stylus reaches {reach * 1e3:.0f} mm up and down from neutral, and the task needs "
            f"{needed * 1e3:.0f} mm: beyond its reach no force is rendered; measure the corners again"
        )
    if device.agent.zero:
        console.print(
            f"agents.{side}.zero, {device.agent.zero:g} m, is subtracted as well: expected 0 for this profile"
        )
    _save(config, replace(known, placement=place), replace_it, quiet=False)
    return 0


def _measured(
    device: Device, ticks: LoopClock, before: Placement, config: Config, ask: Ask | None, *, zero_only: bool
) -> Placement:
    """Measure the neutral height, then two corners, with the stylus held there by the operator."""

    def held(where: str) -> DeviceRun:
        if ask is None:
            console.print(f"Hold the stylus {where}: measured in {SETTLE:g} s")
            watch(device, ticks, SETTLE)
        else:
            ask(f"Hold the stylus {where}, then press Enter: ")
        return watch(device, ticks, HOLD)

    zero = calibration.neutral_at(held("at the neutral height, in the middle"))
    box, needed = None, config.task.stylus_range
    room = Box(*(before if zero_only else Placement()).box).within(device.info.workspace)
    calibration.scale_for(zero[2], room, needed)  # refuses too small a room before the next position is measured
    if not zero_only:
        low = calibration.held_at(held("at the lower far left corner of the workspace"))
        calibration.scale_for(zero[2], room._replace(z_min=low[2]), needed)
        high = calibration.held_at(held("at the upper near right corner of the workspace"))
        box = calibration.box_between(low, high).within(device.info.workspace)
    return calibration.placed(before, zero, box, needed, f"{now_in_words()}, by hand")


@contextmanager
def opened(config: Config, side: Side, real_time: bool, restricted: bool = True) -> Iterator[Device]:
    """Open a side's device in its own frame, without force, in a process prepared for a steady loop."""
    if real_time:
        prepare(config.realtime, Priority.AGENT, cpus_for(side, config.realtime))
    device = registry.make(side, config)
    with interrupted_by_stop_signals(), no_terminal_suspension():
        device.open(placed=False, restricted=restricted)
        with device:
            if real_time:
                steady_loop()
            yield device


def ask_consent(what: str, yes: bool, ask: Ask) -> None:
    """Require consent before the motors move."""
    if yes:
        return
    if not sys.stdin.isatty():
        raise NetboardError(f"this moves a device ({what}); confirm with --yes, or run it in a terminal")
    console.print(f"The motors will move {what}. Keep faces away from the stylus.")
    if ask(f"To continue, type: {CONSENT}  > ").strip().strip('"').casefold() != CONSENT:
        raise NetboardError(f'not confirmed (expected "{CONSENT}"); nothing was moved')


def placement_values(overrides: Sequence[str]) -> tuple[dict[str, str], list[str]]:
    """Split settings into those of a profile's placement and those of the configuration."""
    of_profile = [word for word in overrides if word.startswith("placement.")]
    given = {}
    for word in of_profile:
        key, equals, value = (part.strip() for part in word.removeprefix("placement.").partition("="))
        if not equals or not value:
            raise ConfigError(f"--set {word}: expected placement.key=value, for example placement.zero_z=0.02")
        given[key] = value
    return given, [word for word in overrides if word not in of_profile]


def now_in_words() -> str:
    """Return the date and time in words."""
    return time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime())


def _save(config: Config, known: Profile, replace_it: bool, quiet: bool) -> None:
    """Write a profile, and print its path."""
    folder = Path(config.agents.profiles)
    path = profile.file_of(folder, known.device.serial)
    backup = free_backup(path).name if path.exists() and not replace_it else ""
    profile.save(folder, known, replace=replace_it)
    if not quiet:
        kept = f"; the previous one is now {backup}" if backup else ""
        console.print(f"{path}: written{kept}", soft_wrap=True)


def _print_json(values: Mapping[str, Any]) -> None:
    print(json.dumps(values, default=str))  # noqa: T201


@contextmanager
def _bar(quiet: bool) -> Iterator[Callable[[str], Callable[[float], None]]]:
    """Show a progress bar; yield a function that makes a progress callback for a named part."""
    with progress_bars(console, shown=not quiet) as progress:

        def part(name: str) -> Callable[[float], None]:
            task = progress.add_task(f"{name:12}", total=1.0)
            return lambda done: progress.update(task, completed=done)

        yield part
