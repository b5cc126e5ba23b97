"""Malformed messages for a real server in a trial: what was sent, what it says of it, and what became of the trial.

The agents' devices write down what they are handed, and everything is recorded: whatever disturbs the trial shows.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from netboard.base.clock import now_ns
from netboard.base.config import SIDES
from netboard.base.tick import TICK_NS
from netboard.benchmarks.faults import barrage
from netboard.benchmarks.faults.checks import gentle, goes_on, whole
from netboard.benchmarks.faults.devices import read_traces
from netboard.benchmarks.faults.evidence import between
from netboard.benchmarks.faults.gathering import Evidence, Window, take
from netboard.benchmarks.faults.rigs import Rig, tampered
from netboard.benchmarks.faults.sites import PACE
from netboard.benchmarks.faults.watching import look, memory, memory_part
from netboard.benchmarks.harness.results import Part, Value, Verdict
from netboard.benchmarks.harness.running import Tell
from netboard.network.protocol.joining import Goodbye
from netboard.network.protocol.records import EventRecord
from netboard.nodes.server.tick_clock import LATE_NS
from netboard.recording.files.reader import Recording
from netboard.recording.integrity.verification import verify_recording

IN_SEATS = 0.25
"""Share of the motion socket's malformed messages sent in the agents' place, before a trial starts [1]."""

STREAM_SHARE = 0.01
"""Connections that do not speak ZeroMQ, per message to a socket [1]."""

QUIET_SECONDS = 5.0
"""Duration of the quiet periods before and after, for comparison [s]."""

COUNTED_SECONDS = 2.0
"""Wait for the refusal counts, which the server reports once a second [s]."""

LAST_WORDS = 100
"""Number of messages that contain at least one of most kinds [1]."""

COUNTED = 0.7
"""Smallest share of sent messages that must be reported as refused; cut connections lose some [1]."""


@dataclass(frozen=True)
class Spell:
    """A period of a trial."""

    name: str
    window: Window


def server_parts(folder: Path, count: int, tell: Tell, quiet: float = QUIET_SECONDS) -> Iterator[Part]:
    """Send malformed messages to every socket of a real server."""
    folder.mkdir(parents=True)
    settings, environment = tampered(folder.resolve())
    tell("a server: starting", 0.0)
    with Rig(folder, (*PACE, *settings, "network.log_ring_s=5"), environment) as rig:
        rig.start("logger", "logger", "--once")
        rig.start("server", "server")
        rig.until(lambda status: "logger" in status.peers)
        assaults = _in_seats(rig, round(count * IN_SEATS), tell)
        rig.start_stations()
        rig.start("left display", "display", "--station", "left", "--offscreen")
        rig.until_felt()
        rig.until(lambda status: "display.left" in status.peers)
        first = _spell("nothing", lambda: time.sleep(quiet))
        before = memory(rig)
        others = barrage.as_others(rig.config.network, count)
        vandal = barrage.vandal(rig.config.network, round(count * STREAM_SHARE))
        noisy = _spell("malformed messages", lambda: _fire(rig, others, vandal, tell))
        last = _spell("nothing again", lambda: time.sleep(quiet))
        after = memory(rig)
        tell("a server: judging", 1.0)
        (path,) = rig.finish()
    yield _sockets_part(take([path]).events, [*assaults, *others], vandal)
    yield _trial_part(rig, path, (first, noisy, last))
    yield memory_part("server-memory", "What the processes hold", before, after)


def _spell(name: str, act: Callable[[], object]) -> Spell:
    start_ns = now_ns()
    act()
    return Spell(name, Window(start_ns, now_ns()))


def _in_seats(rig: Rig, count: int, tell: Tell) -> list[barrage.Assault]:
    """Send malformed messages in the agents' place, then disconnect."""
    assaults = barrage.as_agents(rig.config.network, count // len(SIDES))
    barrage.fire(assaults, None, lambda: look(rig), lambda share: tell("a server: in the agents' seats", share))
    for assault in assaults:
        assault.say(Goodbye("enough"))
    rig.until(lambda status: not any(peer.startswith("agent") for peer in status.peers))
    for assault in assaults:
        assault.line.close()
    return assaults


def _fire(rig: Rig, assaults: list[barrage.Assault], vandal: barrage.Vandal, tell: Tell) -> None:
    barrage.fire(assaults, vandal, lambda: look(rig), lambda share: tell("a server: in a trial", share))
    time.sleep(COUNTED_SECONDS)
    for assault in assaults:  # with these it tells how many there were before
        assault.count += LAST_WORDS
        assault.fire(assault.count)
    vandal.close()
    time.sleep(COUNTED_SECONDS)
    for assault in assaults:
        assault.line.close()
    look(rig)


def _sockets_part(events: Sequence[EventRecord], assaults: list[barrage.Assault], vandal: barrage.Vandal) -> Part:
    """Tabulate the messages sent to each socket and the refusals that the server reports."""
    told = barrage.refused(events)
    totals: dict[str, list[int]] = {}
    for assault in assaults:
        total = totals.setdefault(assault.channel, [0, 0, 0])
        for i, number in enumerate((assault.sent, assault.malformed, assault.line.made)):
            total[i] += number
    streams = vandal.sent // len(totals)
    rows: list[tuple[Value, ...]] = []
    shares = []
    for channel, (sent, malformed, made) in totals.items():
        answers = not channel.startswith("view")  # a subscriber gets no answer
        rows.append(
            (channel, sent, malformed if answers else "", told.get(channel, 0) if answers else "", made, streams)
        )
        shares += [told.get(channel, 0) / malformed] if answers else []
    found = f"at least {min(shares):.1%} of those that must be"
    return Part(
        "server-sockets",
        "Malformed messages for the sockets of a server",
        ("socket", "messages [1]", "to be refused [1]", "told [1]", "connections [1]", "without ZeroMQ [1]"),
        rows,
        [Verdict("what is refused is counted and recorded", min(shares) > COUNTED, found)],
    )


def _trial_part(rig: Rig, path: Path, spells: tuple[Spell, ...]) -> Part:
    """Tabulate how the trial went in each period."""
    taken = take([path])
    traces = {side: read_traces(rig.folder, side) for side in SIDES}
    with Recording(path) as recording:
        verdict = verify_recording(recording)
    rows: list[tuple[Value, ...]] = []
    for spell in spells:
        window = spell.window
        ticks = between(taken.ticks, window.start_ns, window.stop_ns)
        late = int(np.sum(ticks["late_ns"] > LATE_NS))
        missed = int(np.sum(np.diff(ticks["time_ns"]) > TICK_NS))
        pauses = sum(window.start_ns <= pause.at_ns < window.stop_ns for pause in taken.pauses)
        rows.append((spell.name, ticks.size, late, 1000 * late / max(ticks.size, 1), missed, pauses))
    whole_window = Window(spells[0].window.start_ns, spells[-1].window.stop_ns)
    cut = {
        side: [between(trace, whole_window.start_ns, whole_window.stop_ns) for trace in found]
        for side, found in traces.items()
    }
    evidence = Evidence(whole_window, rig.config.safety, cut, taken, None)
    same = f"{verdict.checked} ticks computed again"
    return Part(
        "server-trial",
        "The trial meanwhile",
        ("sent", "ticks [1]", "late [1]", "of a thousand [1]", "stood still [1]", "pauses [1]"),
        rows,
        [
            Verdict(
                "the recording is identical to the bit", verdict.identical, same if verdict.identical else str(verdict)
            ),
            whole()(evidence),
            gentle()(evidence),
            goes_on()(evidence),
        ],
    )
