"""What a recording says of its rig: what each hand held, how the displays were drawn, and what an operator confirmed.

Agents and displays describe themselves in the events with which they join, or with which a block begins while they are
there. Recordings from before agents stated the kind of their device have its backend, which tells the kind.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

from netboard.base.config import SIDES, Config, Side
from netboard.base.device_kind import MOVED_BY_SERVER, DeviceKind, device_stand_in, display_stand_in, held_by
from netboard.base.process.display_server import unseen
from netboard.network.protocol.records import DISPLAY_JOINED, DISPLAY_PRESENT, STAND_IN_CONFIRMED, EventRecord
from netboard.recording.format.summary import Attempt, agents_of

REHEARSED = "simulated participant, no device"


@dataclass(frozen=True, slots=True)
class RecordedRig:
    """The rig of a recording."""

    hands: Mapping[Side, tuple[str, ...]]  # what each hand held, in words, in the order of use
    unseen: tuple[Side, ...] = ()  # stations with a display that nobody saw
    simulated: tuple[Side, ...] = ()  # sides whose agents had simulated devices only
    # What stood in for a haptic device or a screen, each with the words of the operator who confirmed it, if any did.
    stand_ins: Mapping[str, str] = field(default_factory=dict)

    @property
    def stand_ins_in_words(self) -> str:
        """The stand-ins, each with what the operator said of it; empty if there are none."""
        return "; ".join(f"{what} ({said or 'not confirmed'})" for what, said in self.stand_ins.items())


def rig_of(
    config: Config, metadata: Mapping[str, str], events: Sequence[EventRecord], attempts: Sequence[Attempt]
) -> RecordedRig:
    """Return the rig of a recording."""
    movers = {side: getattr(config.block, side) for side in SIDES}
    hands: dict[Side, tuple[str, ...]] = {
        side: (MOVED_BY_SERVER[mover],) for side, mover in movers.items() if mover in MOVED_BY_SERVER
    }
    robots = [side for side, mover in movers.items() if mover not in ("person", "still")]
    for side in robots:
        partners = [details for details in agents_in_use(events, attempts, side) if "partner" in details]
        if held := [held_by(details) for details in partners]:  # none where the server moved it
            hands[side] = tuple(dict.fromkeys(one.text for one in held))
    people = [side for side, mover in movers.items() if mover == "person"]
    if metadata.get("rehearsed") == "true":
        hands |= {side: (held_by({"kind": DeviceKind.ROBOT, "partner": movers[side]}).text,) for side in robots}
        return RecordedRig(hands | dict.fromkeys(people, (REHEARSED,)), simulated=tuple(people))
    found: dict[str, None] = {}
    simulated: list[Side] = []
    for side in people:
        held = [held_by(details) for details in agents_in_use(events, attempts, side)]
        hands[side] = tuple(dict.fromkeys(one.text for one in held))
        simulated += [side] * (bool(held) and all(one.kind is DeviceKind.SIMULATED for one in held))
        ways = (one.stand_in(haptics=config.block.haptics) for one in held)
        found |= dict.fromkeys(device_stand_in(side, way) for way in ways if way)
    shown = [event.details for event in events if event.name in {DISPLAY_JOINED, DISPLAY_PRESENT}]
    hidden = tuple(
        side for side in SIDES if any(one.get("side") == side and unseen(one.get("platform", "")) for one in shown)
    )
    found |= dict.fromkeys(map(display_stand_in, hidden))
    said = {one.details.get("what"): _quoted(one.details) for one in events if one.name == STAND_IN_CONFIRMED}
    ordered: dict[Side, tuple[str, ...]] = {side: hands[side] for side in SIDES if side in hands}
    return RecordedRig(ordered, hidden, tuple(simulated), {what: said.get(what, "") for what in found})


def agents_in_use(
    events: Sequence[EventRecord], attempts: Sequence[Attempt], side: Side
) -> Iterator[Mapping[str, str]]:
    """Yield what the agents of a side said of the devices that were in use in an attempt or after it, in order."""
    said, start = agents_of(events).get(side, []), attempts[0].began if attempts else 0
    replaced = [tick for tick, _ in said[1:]]
    for (_, details), until in zip(said, (*replaced, inf), strict=True) if said else ():
        if until > start:
            yield details


def _quoted(details: Mapping[str, str]) -> str:
    """Return an operator's words, and who gave them."""
    return f'confirmed by {details.get("by", "?")}: "{details.get("words", "")}"'
