"""The lamps of a station: device, connection, clock, samples, forces, safety. Pure: no Qt, no clock."""

from collections.abc import Callable
from dataclasses import dataclass
from math import isnan, nan

from netboard.base.config import Side
from netboard.base.device_kind import HIDDEN, STAND_INS, DeviceKind
from netboard.base.plural import plural
from netboard.base.process.display_server import unseen
from netboard.base.safeguards import PARTNER_LET_GO, TRIP_CAUSES, Safeguard
from netboard.network.protocol.control import LinkStatus, StationStatus, Status
from netboard.nodes.ports.emergency import AWAITING_RELEASE
from netboard.windows.operator.changes import LATELY, RecentCounts
from netboard.windows.operator.commands import CONFIRM_KEY
from netboard.windows.operator.lamps import Lamp, LampLevel, LampState, Limits, milliseconds

SLOW_RATE = 900.0
"""Message rate below which an agent counts as slow [Hz]."""


@dataclass(frozen=True, slots=True)
class _Station:
    """State of one side, taken from a status."""

    status: Status
    link: LinkStatus
    device: StationStatus
    bits: Safeguard
    lost: int


def station_lamps(status: Status, recent: RecentCounts, side: Side, limits: Limits) -> tuple[Lamp, ...]:
    """Return the lamps of one station, always the same ones in the same order."""
    agent = f"agent.{side}"
    link = next((link for link in status.links if link.peer == agent), None)
    display = Lamp("Display", *_display(status, side))
    if link is None:
        awaited = any(side in lacking for lacking in status.waiting_for)
        missing = LampLevel.BAD, "missing", f"No agent for the {side} side. Start it: netboard up --station {side}"
        unneeded = LampLevel.OFF, "not needed", "No agent is connected, and this block needs none."
        unknown = [
            Lamp(name, LampLevel.OFF, "", "Known once the agent is connected.") for name in _LAMPS if name != "Device"
        ]
        return (Lamp("Device", *(missing if awaited else unneeded)), *unknown, display)
    nothing = StationStatus(side, nan, 0, 0.0, 0, 0)
    device = next((device for device in status.stations if device.side == side), nothing)
    station = _Station(status, link, device, Safeguard(device.safeguards), recent.lost.get(agent, 0))
    return (*(Lamp(name, *read(station, limits)) for name, read in _LAMPS.items()), display)


def _device(station: _Station, limits: Limits) -> LampState:
    name, version = station.link.name, station.link.version
    held = next((one for one in station.status.devices if one.side == station.device.side), None)
    if Safeguard.DEVICE_LOST in station.bits:
        tip = "The device does not answer. Check its cable and power; the agent reconnects by itself."
        return LampLevel.BAD, "lost", tip
    if Safeguard.NOT_READY in station.bits and held is not None and held.kind == DeviceKind.ROBOT:
        return LampLevel.BAD, "let go", f"Force zero: {PARTNER_LET_GO}. It holds it again in the next block."
    if Safeguard.NOT_READY in station.bits:
        tip = "Not calibrated, not held, or outside its workspace: calibrate it, and hold the stylus."
        return LampLevel.WATCH, "not ready", tip
    if version != limits.version:
        tip = f"The agent {name} has version {version}, this console {limits.version}. Install the same everywhere."
        return LampLevel.WATCH, f"v{version}", tip
    agent = f"Agent {name}, version {version}."
    if held is None:
        return LampLevel.GOOD, "ready", agent
    if held.kind == "still":
        return LampLevel.OFF, held.kind, f"No device moves this hand: {held.text}."
    tip = f"{held.text}. {agent}"
    if held.kind == HIDDEN:
        return LampLevel.GOOD, "ready", tip
    if held.kind != DeviceKind.HAPTIC:
        level, must = _stand_in(station.status, f"{held.side} device")
        return level, STAND_INS[DeviceKind(held.kind)], f"{tip}{must}"
    return LampLevel.GOOD, held.model or "ready", tip


def _stand_in(status: Status, what: str) -> tuple[LampLevel, str]:
    """Return the level of a stand-in, and what the operator must do about it."""
    awaited = [one.words for one in status.stand_ins if one.words.startswith(what) and not one.confirmed]
    if status.real and awaited:
        return LampLevel.BAD, f" In a REAL session, confirm it in words ({CONFIRM_KEY}): {', '.join(awaited)}"
    return LampLevel.WATCH, " Its data are not those of a haptic device." if what.endswith("device") else ""


def _link(station: _Station, limits: Limits) -> LampState:
    age, rate = station.link.age, station.link.rate
    tip = f"Last message {milliseconds(age)} ago, {rate:.0f} messages per second."
    if age > limits.sample_age:
        return LampLevel.BAD, "silent", f"{tip} Check the cable, and that the station is switched on."
    if rate < SLOW_RATE:
        return LampLevel.WATCH, f"{rate:.0f} Hz", f"{tip} Expected 1000. Close other programs on the station."
    return LampLevel.GOOD, f"{rate:.0f} Hz", tip


def _round_trip(station: _Station, limits: Limits) -> LampState:
    trip = station.link.round_trip
    tip = f"Shortest recent round-trip time: {milliseconds(trip)}."
    if isnan(trip):
        return LampLevel.WATCH, "unknown", "Not measured yet; wait a few seconds."
    if trip > limits.sample_age:
        return LampLevel.BAD, milliseconds(trip), f"{tip} The network is too slow for a trial."
    if trip > 2 * limits.clock_bound:
        worry = (
            f"{tip} Above {milliseconds(2 * limits.clock_bound)} the clock offset is uncertain: use a cable, not Wi-Fi."
        )
        return LampLevel.WATCH, milliseconds(trip), worry
    return LampLevel.GOOD, milliseconds(trip), tip


def _clock(station: _Station, limits: Limits) -> LampState:
    bound = station.link.clock_bound
    if not bound <= limits.clock_bound:  # NaN included
        limit = milliseconds(limits.clock_bound)
        tip = f"The device is armed once the error of its clock offset is below {limit}. Wait, or check the network."
        return LampLevel.BAD, "unknown" if isnan(bound) else f"\u00b1{milliseconds(bound)}", tip
    level = LampLevel.WATCH if bound > limits.clock_bound / 2 else LampLevel.GOOD
    tip = f"Error of the clock offset: at most {milliseconds(bound)}; limit {milliseconds(limits.clock_bound)}."
    return level, f"\u00b1{milliseconds(bound)}", tip


def _sample(station: _Station, limits: Limits) -> LampState:
    if isnan(station.device.age):
        return LampLevel.BAD, "none", "No sample of the stylus so far: check the device."
    words, most = f"{milliseconds(station.device.age)} old", milliseconds(limits.sample_age)
    tip = f"The newest sample of the stylus is {words}; a trial pauses at {most}."
    if station.device.age > limits.sample_age:
        return LampLevel.BAD, words, f"{tip} Check network and device."
    level = LampLevel.WATCH if station.device.age > limits.sample_age / 5 else LampLevel.GOOD
    return level, words, tip


def _latency(station: _Station, limits: Limits) -> LampState:
    loops = (loop for loop in station.status.loops if loop.peer == station.link.peer)
    _, late, most = next(loops, ("", nan, nan))
    if isnan(late):
        return LampLevel.OFF, "unknown", "Sample-to-force latency: not measured yet."
    words = milliseconds(late)
    tip = f"Sample-to-force latency {words}. With no hand on it, the stylus is stable up to {milliseconds(most)}."
    if late > most:
        return LampLevel.BAD, words, f"{tip} The stylus may vibrate: pause (F5), and check the network."
    level = LampLevel.WATCH if late > most / 2 else LampLevel.GOOD
    return level, words, tip


def _drops(station: _Station, limits: Limits) -> LampState:
    tip = (
        f"Messages lost in the last {LATELY:g} s: {station.lost}; since the start: {station.link.lost}. "
        f"Ticks of this attempt without a fresh sample: {station.device.lost_ticks}."
    )
    most = max(station.lost, station.device.lost_ticks)
    if most > limits.lost_ticks:
        return LampLevel.BAD, plural(most, "drop"), f"{tip} This attempt will be flagged: check the network."
    return LampLevel.WATCH if most else LampLevel.GOOD, plural(most, "drop") if most else "none", tip


def _force(station: _Station, limits: Limits) -> LampState:
    known = not isnan(station.device.rendered)
    words = f"{station.device.rendered:+.2f} N" if known else "unknown"
    tip = f"Vertical force on the hand. Ticks of this attempt at the force limit: {station.device.clipped_ticks}."
    if Safeguard.CLAMPED in station.bits:
        return LampLevel.WATCH, f"AT LIMIT {words}", f"{tip} The commanded force is above the limit."
    if Safeguard.SLEWED in station.bits:
        return LampLevel.WATCH, f"SLEW {words}", f"{tip} The commanded force changes too fast."
    if station.device.clipped_ticks > limits.clipped_ticks:
        return LampLevel.WATCH, f"LIMITED {words}", f"{tip} This attempt will be flagged."
    return LampLevel.GOOD if known else LampLevel.WATCH, words, tip


_TRIPS = (
    (Safeguard.STOPPED, "STOPPED"),
    (Safeguard.DEVICE_LOST, "device lost"),
    (Safeguard.NOT_FINITE, "not a number"),
    (Safeguard.TOO_FAST, "too fast"),
    (Safeguard.STALE, "stale force"),
    (Safeguard.WORN, "motor limit"),
)


def _safety(station: _Station, _limits: Limits) -> LampState:
    for cause, words in _TRIPS:
        if cause in station.bits:
            return LampLevel.BAD, words, f"Force reduced or zero: {TRIP_CAUSES[cause]}."
    if Safeguard.RAMPING in station.bits:
        return LampLevel.WATCH, "arming", "Just armed: the force is increasing to its full value."
    if Safeguard.ARMED in station.bits:
        return LampLevel.GOOD, "ARMED", "The device renders forces."
    if station.status.armed and AWAITING_RELEASE not in station.status.waiting_for:
        return LampLevel.WATCH, "not armed", "Forces are allowed, but this device renders none: see the lamps above."
    return LampLevel.OFF, "disarmed", "The device renders no force."


def _display(status: Status, side: Side) -> LampState:
    what = f"display.{side}"
    platform = next((shown.platform for shown in status.displays if shown.side == side), "")
    start = f"Start it: netboard display --station {side}"
    if what in status.peers and unseen(platform):
        level, must = _stand_in(status, f"{side} display")
        return level, "off screen", f"Nobody sees the display of the {side} participant: it is drawn off screen.{must}"
    if what in status.peers:
        return LampLevel.GOOD, "connected", f"The display of the {side} participant is connected."
    if what in status.waiting_for:
        return LampLevel.BAD, "missing", start
    return LampLevel.WATCH, "none", f"This participant has no display. {start}"


_LAMPS: dict[str, Callable[[_Station, Limits], LampState]] = {
    "Device": _device,
    "Link": _link,
    "Round trip": _round_trip,
    "Clock": _clock,
    "Sample": _sample,
    "Latency": _latency,
    "Drops": _drops,
    "Force": _force,
    "Safety": _safety,
}
STATION_LAMPS = (*_LAMPS, "Display")
"""Names of a station's lamps."""
