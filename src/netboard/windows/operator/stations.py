"""The lamps of a station: device, link, clock, samples, forces, safety. Pure: no Qt, no clock."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan, nan

from netboard.base.config import Side
from netboard.network.protocol.control import Status
from netboard.network.protocol.motion import Safeguard
from netboard.nodes.ports.emergency import LACKING, WORDS
from netboard.windows.operator.changes import LATELY, Recent
from netboard.windows.operator.lamps import Lamp, Level, Limits, milliseconds

SLOW_RATE = 900.0
"""Message rate below which an agent counts as slow [Hz]."""


@dataclass(frozen=True, slots=True)
class _Seat:
    """State of one side, taken from a status."""

    side: Side
    status: Status
    link: tuple[str, str, str, float, float, float, float, float, int]
    age: float
    bits: Safeguard
    rendered: float
    lost_ticks: int
    clipped_ticks: int
    lost: int


def station_lamps(status: Status, recent: Recent, side: Side, limits: Limits) -> tuple[Lamp, ...]:
    """Return the lamps of one station, always the same ones in the same order."""
    agent = f"agent.{side}"
    link = next((link for link in status.links if link[0] == agent), None)
    display = _display(status, side)
    if link is None:
        awaited = any(side in lacking for lacking in status.waiting_for)
        device = (
            Lamp(
                "Device", Level.BAD, "missing", f"No agent for the {side} hand. Start it: netboard up --station {side}"
            )
            if awaited
            else Lamp("Device", Level.OFF, "not needed", "No agent is here, and none is awaited.")
        )
        dark = [Lamp(name, Level.OFF, "", "Shown when the agent is here.") for name in _NAMES[1:]]
        return (device, *dark, display)
    found = next((station for station in status.stations if station[0] == side), (side, nan, 0, 0.0, 0, 0))
    _, age, bits, rendered, lost_ticks, clipped_ticks = found
    seat = _Seat(
        side, status, link, age, Safeguard(bits), rendered, lost_ticks, clipped_ticks, recent.lost.get(agent, 0)
    )
    return (*(lamp(seat, limits) for lamp in _LAMPS), display)


def _device(seat: _Seat, limits: Limits) -> Lamp:
    _, name, version, *_ = seat.link
    if Safeguard.DEVICE_LOST in seat.bits:
        tip = "The device does not answer. Look at its cable and its power; the agent finds it again by itself."
        return Lamp("Device", Level.BAD, "lost", tip)
    if Safeguard.NOT_READY in seat.bits:
        tip = "Not calibrated, not in a hand, or outside of its workspace: calibrate it, take it in the hand."
        return Lamp("Device", Level.WATCH, "not ready", tip)
    if version != limits.version:
        tip = f"The agent {name} has version {version}, this console {limits.version}. Install the same everywhere."
        return Lamp("Device", Level.WATCH, f"v{version}", tip)
    return Lamp("Device", Level.GOOD, "ready", f"Agent {name}, version {version}.")


def _link(seat: _Seat, limits: Limits) -> Lamp:
    heard, rate = seat.link[3], seat.link[7]
    tip = f"Heard {milliseconds(heard)} ago, {rate:.0f} messages a second."
    if heard > limits.sample_age:
        return Lamp("Link", Level.BAD, "silent", f"{tip} Look at the cable, and whether the station is on.")
    if rate < SLOW_RATE:
        return Lamp("Link", Level.WATCH, f"{rate:.0f} Hz", f"{tip} Expected 1000: look at the load of the station.")
    return Lamp("Link", Level.GOOD, f"{rate:.0f} Hz", tip)


def _round_trip(seat: _Seat, limits: Limits) -> Lamp:
    trip = seat.link[4]
    tip = f"Shortest round trip of late: {milliseconds(trip)}."
    if isnan(trip):
        return Lamp("Round trip", Level.WATCH, "unknown", "Not measured yet; wait some seconds.")
    if trip > limits.sample_age:
        return Lamp("Round trip", Level.BAD, milliseconds(trip), f"{tip} The network is too slow for a trial.")
    if trip > 2 * limits.clock_bound:
        worry = f"{tip} Above {milliseconds(2 * limits.clock_bound)} the clock cannot be known well: use a cable."
        return Lamp("Round trip", Level.WATCH, milliseconds(trip), worry)
    return Lamp("Round trip", Level.GOOD, milliseconds(trip), tip)


def _clock(seat: _Seat, limits: Limits) -> Lamp:
    bound = seat.link[5]
    if not bound <= limits.clock_bound:  # NaN included
        known = f"its clock is known to {milliseconds(limits.clock_bound)}"
        tip = f"The device is not armed until {known}: wait some seconds, or see to the link."
        return Lamp("Clock", Level.BAD, "unknown" if isnan(bound) else f"\u00b1{milliseconds(bound)}", tip)
    level = Level.WATCH if bound > limits.clock_bound / 2 else Level.GOOD
    tip = f"The station's clock is known to {milliseconds(bound)}; limit {milliseconds(limits.clock_bound)}."
    return Lamp("Clock", level, f"\u00b1{milliseconds(bound)}", tip)


def _sample(seat: _Seat, limits: Limits) -> Lamp:
    if isnan(seat.age):
        return Lamp("Sample", Level.BAD, "none", "The stylus has never been read: look at the device.")
    words, most = f"{milliseconds(seat.age)} old", milliseconds(limits.sample_age)
    tip = f"The newest reading of the stylus is {words}; a trial pauses at {most}."
    if seat.age > limits.sample_age:
        return Lamp("Sample", Level.BAD, words, f"{tip} Look at the link and the device.")
    level = Level.WATCH if seat.age > limits.sample_age / 5 else Level.GOOD
    return Lamp("Sample", level, words, tip)


def _loop(seat: _Seat, limits: Limits) -> Lamp:
    late, most = next((loop[1:] for loop in seat.status.loops if loop[0] == seat.link[0]), (nan, nan))
    if isnan(late):
        return Lamp("Loop", Level.OFF, "unknown", "From reading the stylus to rendering the answer: not measured yet.")
    words = milliseconds(late)
    tip = (
        f"From reading the stylus to rendering the answer: {words}; alone the device is stable to {milliseconds(most)}."
    )
    if late > most:
        return Lamp(
            "Loop", Level.BAD, milliseconds(late), f"{tip} The hand may feel a buzz: pause, and see to the link."
        )
    level = Level.WATCH if late > most / 2 else Level.GOOD
    return Lamp("Loop", level, words, tip)


def _drops(seat: _Seat, limits: Limits) -> Lamp:
    tip = (
        f"Messages lost in the last {LATELY:g} s: {seat.lost}, since the start: {seat.link[8]}. "
        f"Ticks of this attempt without a fresh sample: {seat.lost_ticks}."
    )
    most = max(seat.lost, seat.lost_ticks)
    if most > limits.lost_ticks:
        return Lamp("Drops", Level.BAD, f"{most} drops", f"{tip} The trial will be doubtful: see to the link.")
    return Lamp("Drops", Level.WATCH if most else Level.GOOD, f"{most} drops" if most else "none", tip)


def _force(seat: _Seat, limits: Limits) -> Lamp:
    known = not isnan(seat.rendered)
    words = f"{seat.rendered:+.2f} N" if known else "unknown"
    tip = f"Vertical force on the hand. Ticks of this attempt with a force at its limit: {seat.clipped_ticks}."
    if Safeguard.CLAMPED in seat.bits:
        return Lamp("Force", Level.WATCH, f"CLAMP {words}", f"{tip} The force wanted is above the device's limit now.")
    if Safeguard.SLEWED in seat.bits:
        return Lamp("Force", Level.WATCH, f"SLEW {words}", f"{tip} The force wanted changes faster than allowed.")
    if seat.clipped_ticks > limits.clipped_ticks:
        return Lamp("Force", Level.WATCH, f"CLIP {words}", f"{tip} The trial will be doubtful.")
    return Lamp("Force", Level.GOOD if known else Level.WATCH, words, tip)


_TRIPS = (
    (Safeguard.STOPPED, "STOPPED"),
    (Safeguard.DEVICE_LOST, "device lost"),
    (Safeguard.NOT_FINITE, "not a number"),
    (Safeguard.TOO_FAST, "too fast"),
    (Safeguard.STALE, "stale force"),
    (Safeguard.WORN, "motors worn"),
)


def _safety(seat: _Seat, _limits: Limits) -> Lamp:
    for cause, words in _TRIPS:
        if cause in seat.bits:
            return Lamp("Safety", Level.BAD, words, f"No force, or less of it: {WORDS[cause]}.")
    if Safeguard.RAMPING in seat.bits:
        return Lamp("Safety", Level.WATCH, "arming", "Armed a moment ago: the force is let in over a second.")
    if Safeguard.ARMED in seat.bits:
        return Lamp("Safety", Level.GOOD, "ARMED", "The device gives forces.")
    if seat.status.armed and LACKING not in seat.status.waiting_for:
        return Lamp("Safety", Level.WATCH, "not armed", "It is let, but does not give forces: look at the lamps above.")
    return Lamp("Safety", Level.OFF, "disarmed", "The device gives no force.")


def _display(status: Status, side: Side) -> Lamp:
    what = f"display.{side}"
    start = f"Start it: netboard display --station {side}"
    if what in status.peers:
        return Lamp("Display", Level.GOOD, "there", f"The {side} participant's display is connected.")
    if what in status.waiting_for:
        return Lamp("Display", Level.BAD, "missing", start)
    return Lamp("Display", Level.WATCH, "none", f"This participant sees nothing. {start}")


_LAMPS: tuple[Callable[[_Seat, Limits], Lamp], ...] = (
    _device,
    _link,
    _round_trip,
    _clock,
    _sample,
    _loop,
    _drops,
    _force,
    _safety,
)
_NAMES = ("Device", "Link", "Round trip", "Clock", "Sample", "Loop", "Drops", "Force", "Safety")
STATION_LAMPS = (*_NAMES, "Display")
"""Names of a station's lamps."""
