"""Commands of a replay, from the network or from a key. Pure.

A replay moves no hand, so every connected peer may command it. Commands that belong to a live session are refused.
"""

from collections.abc import Callable
from dataclasses import dataclass

from netboard.base.errors import NetboardError
from netboard.base.number import number_of, whole_of
from netboard.network.protocol.control import REPLAY_COMMANDS, SHARED_COMMANDS
from netboard.recording.replay.loaded import LoadedRecording
from netboard.recording.replay.marks import ANY, KINDS, near
from netboard.recording.replay.position import SPEEDS, ReplayPosition, clock

KNOWN = (*REPLAY_COMMANDS, *SHARED_COMMANDS)
"""All commands of a replay."""

MOST = 2**53
"""Upper bound of tick and trial numbers [1]."""

_LOOP = "on, off, trial N, or two times in seconds"


@dataclass(frozen=True, slots=True)
class ReplayCommand:
    """A command to carry out."""

    name: str
    argument: str


KEYS: dict[str, ReplayCommand] = {
    " ": ReplayCommand("toggle", ""),
    "left": ReplayCommand("seek", "-1"),
    "right": ReplayCommand("seek", "+1"),
    "up": ReplayCommand("faster", "1"),
    "down": ReplayCommand("faster", "-1"),
    "+": ReplayCommand("faster", "1"),
    "-": ReplayCommand("faster", "-1"),
    ".": ReplayCommand("step", "1"),
    ",": ReplayCommand("step", "-1"),
    "n": ReplayCommand("next", ""),
    "p": ReplayCommand("previous", ""),
    "l": ReplayCommand("loop", ""),
    "q": ReplayCommand("end", ""),
}
"""Commands of the terminal's keys."""

KEYS_LINE = "space: play, pause   ← →: 1 s   ↑ ↓ + -: speed   , .: one tick   p n: trial   l: loop   q: quit"
"""The terminal's keys in one line."""


def run_command(
    playback: ReplayPosition, recording: LoadedRecording, now: float, command: ReplayCommand
) -> ReplayPosition:
    """Carry out a command."""
    run = _COMMANDS.get(command.name)
    if run is None:
        known = ", ".join(sorted(KNOWN))
        raise NetboardError(f"cannot {command.name}: this is a replay of {recording.name}; expected one of {known}")
    return run(playback, recording, now, command.argument.strip().lower())


def in_words(playback: ReplayPosition, recording: LoadedRecording, now: float) -> str:
    """Describe the position and state of a replay."""
    here = playback.now(now)
    parts = [f"{'playing' if here.playing else 'paused'} at {clock(here.position)} of {clock(here.length)}"]
    parts.append(f"{here.speed:g} times real time")
    if here.loop is not None:
        parts.append(f"loop {clock(here.loop[0])} to {clock(here.loop[1])}")
    return ", ".join((*parts, recording.where(here.position)))


def _seek(playback: ReplayPosition, recording: LoadedRecording, now: float, argument: str) -> ReplayPosition:
    what, _, which = argument.partition(" ")
    if what == "trial":
        return playback.seek(now, _trial(recording, which)[0])
    if what == "tick":
        return playback.seek(now, recording.time_of(_whole("seek tick", which)))
    position = _number("seek", argument, "seconds (12.5), seconds from here (+2, -2), trial N or tick N")
    return playback.move(now, position) if argument[0] in "+-" else playback.seek(now, position)


def _speed(playback: ReplayPosition, _recording: LoadedRecording, now: float, argument: str) -> ReplayPosition:
    least, most = SPEEDS[0], SPEEDS[-1]
    speed = _number("speed", argument, f"{least:g} to {most:g} times real time")
    if not least <= speed <= most:
        raise NetboardError(f'speed: found "{argument}", expected {least:g} to {most:g} times real time')
    return playback.pace(now, speed)


def _step(playback: ReplayPosition, recording: LoadedRecording, now: float, argument: str) -> ReplayPosition:
    back, _, count = argument.partition(" ")
    ticks = -_whole("step back", count or "1") if back == "back" else _whole("step", argument or "1")
    here = playback.pause(now)
    return here.seek(now, recording.stepped(here.position, ticks))


def _loop(playback: ReplayPosition, recording: LoadedRecording, now: float, argument: str) -> ReplayPosition:
    words = argument.split()
    match words:
        case [] if playback.loop is not None:
            return playback.repeat(now, None)
        case ["off"]:
            return playback.repeat(now, None)
        case [] | ["on"]:
            part = (0.0, recording.length)
        case ["trial", which]:
            part = _trial(recording, which)
        case [begin, end]:
            part = _number("loop", begin, _LOOP), _number("loop", end, _LOOP)
        case _:
            raise NetboardError(f'loop: found "{argument}", expected {_LOOP}')
    try:
        looped = playback.repeat(now, part)
    except ValueError:
        raise NetboardError(f'loop: found "{argument}", expected two times within {recording.length:g} s') from None
    inside = looped.loop is not None and looped.loop[0] <= looped.position < looped.loop[1]
    return looped if inside else looped.seek(now, part[0])


def _go(back: bool) -> Callable[[ReplayPosition, LoadedRecording, float, str], ReplayPosition]:
    """Return the command that goes to the next or previous mark."""

    def go(playback: ReplayPosition, recording: LoadedRecording, now: float, argument: str) -> ReplayPosition:
        kind = argument or "trial"
        where = "before" if back else "after"
        if kind not in (*KINDS, ANY):
            raise NetboardError(f'found "{argument}", expected {ANY} or one of its kinds: {", ".join(KINDS)}')
        mark = near(recording.marks, playback.at(now), kind, back=back)
        if mark is None:
            raise NetboardError(f"no {kind} comes {where} {clock(playback.at(now))}")
        return playback.seek(now, mark.time)

    return go


def _trial(recording: LoadedRecording, which: str) -> tuple[float, float]:
    found = recording.trial(_whole("trial", which))
    if found is None:
        known = f"trials {recording.trials[0]} to {recording.trials[-1]}" if recording.trials else "no trial"
        raise NetboardError(f"there is no trial {which}: {recording.name} has {known}")
    return found


def _whole(name: str, text: str) -> int:
    try:
        number = whole_of(text)
    except ValueError:
        number = MOST + 1
    if abs(number) > MOST:
        raise NetboardError(f'{name}: found "{text}", expected a whole number')
    return number


def _number(name: str, text: str, expected: str) -> float:
    try:
        return number_of(text)
    except ValueError:
        raise NetboardError(f'{name}: found "{text}", expected {expected}') from None


_COMMANDS: dict[str, Callable[[ReplayPosition, LoadedRecording, float, str], ReplayPosition]] = {
    "play": lambda playback, _recording, now, _argument: playback.play(now),
    "resume": lambda playback, _recording, now, _argument: playback.play(now),
    "pause": lambda playback, _recording, now, _argument: playback.pause(now),
    "toggle": lambda playback, _recording, now, _argument: playback.toggle(now),
    "end": lambda playback, _recording, now, _argument: playback.pause(now),
    "seek": _seek,
    "speed": _speed,
    "faster": lambda playback, _recording, now, argument: playback.faster(now, int(argument)),
    "step": _step,
    "loop": _loop,
    "next": _go(back=False),
    "previous": _go(back=True),
}
