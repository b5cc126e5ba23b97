"""Configuration: one TOML text for rig and experiment, validated and parsed into frozen dataclasses.

Every default is the paper's. Every quantity is in SI units and says so in its metadata, from which error messages, the
commented template of ``netboard config init`` and the documentation are made. An unknown key, a wrong type or a value
out of range is a `ConfigError` that names source, table and key and says what was expected.

This module parses text; it opens no file (the services do), so the pure part may import the dataclasses.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from pydantic import TypeAdapter

from netboard.base.errors import ConfigError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, MAX_LABEL, read, write, write_template
from netboard.base.tables.experiment import MAX_TRIALS, Block, Design, Quality, Session, Task
from netboard.base.tables.forces import CONDITIONS, FORCES
from netboard.base.tables.outcomes import Declaration
from netboard.base.tables.perturbations import Perturbation
from netboard.base.tables.questionnaires import Form
from netboard.base.tables.rig import (
    MOUSE,
    VIEW_REPEAT_MS,
    Agents,
    Display,
    Fixture,
    Network,
    Partners,
    Realtime,
    RecordingSettings,
    Safety,
    Stations,
)
from netboard.base.tables.scene import FRICTION, Geometry, Physics, friction_rate
from netboard.base.tables.simulated import Participant, VirtualDevice
from netboard.base.tables.triggers import Triggers, contradictions_of_triggers
from netboard.base.tick import HEARTBEAT_TICKS, TICK_SECONDS

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")

TEMPLATE_HEAD = """\
# netboard: one rig and one experiment.
# Every key is here with its default, which is the paper's. A key left out takes its default;
# an unknown one is an error.
# Check this file with: netboard config check

"""


@dataclass(frozen=True, slots=True)
class Config:
    """Everything: one rig and one experiment."""

    __pydantic_config__ = FORBID_UNKNOWN_KEYS
    session: Session = field(default_factory=Session)
    block: Block = field(default_factory=Block)
    perturbation: Perturbation = field(default_factory=Perturbation)
    form: Form = field(default_factory=Form)
    design: Design = field(default_factory=Design)
    analysis: Declaration = field(default_factory=Declaration)
    quality: Quality = field(default_factory=Quality)
    task: Task = field(default_factory=Task)
    physics: Physics = field(default_factory=Physics)
    geometry: Geometry = field(default_factory=Geometry)
    network: Network = field(default_factory=Network)
    stations: Stations = field(default_factory=Stations)
    realtime: Realtime = field(default_factory=Realtime)
    safety: Safety = field(default_factory=Safety)
    fixture: Fixture = field(default_factory=Fixture)
    agents: Agents = field(default_factory=Agents)
    partners: Partners = field(default_factory=Partners)
    virtual: VirtualDevice = field(default_factory=VirtualDevice)
    participant: Participant = field(default_factory=Participant)
    display: Display = field(default_factory=Display)
    recording: RecordingSettings = field(default_factory=RecordingSettings)
    triggers: Triggers = field(default_factory=Triggers)


ADAPTER: TypeAdapter[Config] = TypeAdapter(Config)


def parse(text: str, source: str = "netboard.toml", overrides: Sequence[str] = (), given: str = "--set") -> Config:
    """Validate a TOML text and parse it into a `Config`.

    Parameters
    ----------
    overrides : sequence of str
        Settings as ``table.key=value`` that take precedence over those of the text.
    given : str
        Options of the command line that gave them, for error messages.

    Raises
    ------
    ConfigError
        If the text is not TOML, a key is unknown, of the wrong type or out of range, or two keys contradict each
        other. The message has a line for every problem.
    """
    config = read(ADAPTER, Config, text, source, overrides)
    origin = f"{source} with {given}" if overrides else source
    problems = [f"{origin}: {problem}" for problem in contradictions(config)]
    if problems:
        raise ConfigError("\n".join(problems))
    return config


def require_short_names(session: Session, source: str) -> None:
    """Refuse a new session whose names are too long for the names of files; `parse` also reads old recordings.

    Parameters
    ----------
    session : Session
        The table ``[session]``.
    source : str
        Where it comes from, for error messages.

    Raises
    ------
    ConfigError
        If a name is too long. The message has a line for each.
    """
    names = {key: len(getattr(session, key)) for key in ("name", "dyad", "participant_a", "participant_b")}
    problems = [
        f"{source}: [session] {key}: found {length} characters, expected at most {MAX_LABEL}"
        for key, length in names.items()
        if length > MAX_LABEL
    ]
    if problems:
        raise ConfigError("\n".join(problems))


def require_effective(config: Config, source: str) -> None:
    """Refuse settings that defeat each other; `parse` also reads old recordings, which may have them.

    Parameters
    ----------
    source : str
        Where the configuration comes from, for error messages.

    Raises
    ------
    ConfigError
        If there are any. The message has a line for each.
    """
    if problems := [f"{source}: {problem}" for problem in _without_effect(config)]:
        raise ConfigError("\n".join(problems))


def _without_effect(config: Config) -> Iterator[str]:
    """Yield a sentence for each setting that has no effect, or makes another one useless."""
    for side, agent in zip(SIDES, (config.agents.left, config.agents.right), strict=True):
        if both := agent.stop_buttons & agent.consent_buttons:
            yield (
                f"[agents.{side}] stop_buttons, consent_buttons: found {both} in both, expected different buttons, "
                "because no force can be rendered while a stop button is pressed"
            )
    for key, address in (("host", config.network.host), ("bind", config.network.bind)):
        if re.match("\\[?fe[89ab][0-9a-f]:[^%]*$", address, re.IGNORECASE):
            yield (
                f'[network] {key}: found "{address}", a link-local address, expected its network interface, too, such '
                f'as "{address.strip("[]")}%eth0"'
            )
    for key, cpus in (("server_cpus", config.realtime.server_cpus), ("agent_cpus", config.realtime.agent_cpus)):
        for first, last in re.findall("([0-9]+)-([0-9]+)", cpus):
            if int(first) > int(last):
                yield f'[realtime] {key}: found "{first}-{last}", expected "{last}-{first}"'
    interval_ms = max(VIEW_REPEAT_MS, 1000 / config.network.view_rate_hz)
    if (timeout_ms := config.display.link_timeout_ms) < 2 * interval_ms:  # one late view is no lost link
        yield (
            f"[display] link_timeout_ms: found {timeout_ms:g}, expected at least {2 * interval_ms:g}, because "
            f"views can be {interval_ms:g} ms apart"
        )


def resolve(config: Config) -> str:
    """Write every key of a configuration as TOML; `parse` returns an equal configuration, to the last bit."""
    return write(config)


def template() -> str:
    """Write the defaults as TOML, with a comment at every key."""
    return TEMPLATE_HEAD + write_template(Config)


def played_sides(config: Config) -> tuple[Side, ...]:
    """Return the sides whose device is the mouse: a person plays them in the display's window."""
    return tuple(side for side in SIDES if config.agents.of(side).device == MOUSE)


def digest(config: Config) -> str:
    """Return the SHA-256 of a resolved configuration, in hexadecimal; equal configurations have equal hashes."""
    return hashlib.sha256(resolve(config).encode()).hexdigest()


def contradictions(config: Config) -> Iterator[str]:
    """Yield a sentence for all keys that contradict each other, with table, key, value and the expected value."""
    yield from contradictions_of_scene(config.physics)
    yield from _of_friction(config.physics)
    yield from _of_block(config.block)
    yield from _of_design(config.design)
    yield from _of_force(config.block, config.physics)
    yield from _of_perturbation(config)
    yield from _of_sizes(config.geometry, config.task, config.physics)
    yield from _of_safety(config.safety)
    yield from contradictions_of_triggers(config.triggers)


def contradictions_of_scene(physics: Physics) -> Iterator[str]:
    """Yield a sentence, as in `contradictions`, for all keys of a scene that contradict each other."""
    needs: dict[str, tuple[bool, str]] = {
        "ball_inertia": (physics.balls > 0, "balls = 1 or more"),
        "ball_stop": (physics.balls > 0, "balls = 1 or more"),
        "restitution": (physics.ball_stop > 0, "a ball_stop"),
        "ball_height": (physics.model == "lagrangian", 'model = "lagrangian": in the paper\'s a ball is a point'),
        "b_z": (physics.board != "hinged", "a board that heaves"),
        "b_theta": (physics.board != "level", "a board that tilts"),
        **dict.fromkeys(FRICTION, (physics.balls > 0, "balls = 1 or more")),
    }
    for key, (there, what) in needs.items():
        if getattr(physics, key) > 0 and not there:
            yield f"[physics] {key}: found {getattr(physics, key):g}, which needs {what}; expected 0"
    if physics.ball_height > 0 and physics.balls == 0:
        yield f"[physics] ball_height: found {physics.ball_height:g}, which needs balls = 1 or more; expected 0"
    if physics.model == "lagrangian" and physics.ball_sign == "printed":
        yield (
            '[physics] ball_sign: found "printed", expected "downhill": only the paper\'s model can have a ball '
            "that rolls uphill"
        )
    if physics.method == "exact" and (physics.board != "level" or friction_rate(physics) > 0):
        yield '[physics] method: found "exact", expected another one: it is for board = "level" without friction'


def _of_friction(physics: Physics) -> Iterator[str]:
    """Find friction that is too strong for ticks."""
    if friction_rate(physics) * TICK_SECONDS > 1.0:
        keys = [key for key in FRICTION if getattr(physics, key) > 0]
        found = ", ".join(f"{getattr(physics, key):g}" for key in keys)
        yield (
            f"[physics] {', '.join(keys)}: found {found}, which can stop a ball within a tick; "
            f"expected at most {1.0 / (friction_rate(physics) * TICK_SECONDS):.3g} times as much"
        )


def _of_block(block: Block) -> Iterator[str]:
    """Find contradictions in a block."""
    if block.number > block.blocks:
        yield f"[block] number: found {block.number}, expected at most {block.blocks} ([block] blocks)"
    if CONDITIONS[block.force].recorded != bool(block.unrelated):
        wanted = 'a recording, which force = "unrelated" needs' if not block.unrelated else 'none without "unrelated"'
        yield f'[block] unrelated: found "{block.unrelated}", expected {wanted}'
    if block.left == block.right == "still":
        yield '[block] left, right: found "still" and "still", expected a person or a robot partner at one of them'
    if block.configuration == "bimanual" and (block.left, block.right) != ("person", "person"):
        yield '[block] left, right: expected "person" and "person" in a bimanual block'
    for trial in block.catch:
        if not 1 <= trial <= MAX_TRIALS:
            yield f"[block] catch: found {trial}, expected numbers of trials, from 1 to {MAX_TRIALS}"
    for scale in block.trial_scales:
        if not 0 <= scale <= 2:
            yield f"[block] trial_scales: found {scale:g}, expected numbers from 0 to 2"
    if block.trial_scales and block.force == "none":
        yield '[block] trial_scales: found some with force = "none", expected none'


def _of_design(design: Design) -> Iterator[str]:
    """Find undeclared levels of factors."""
    for name in design.trials:
        if name in design.factors or not design.trials[name]:
            yield f"[design] trials.{name}: expected a level for each trial, and no level of the block in factors"
    for name, levels in design.levels.items():
        given = {design.factors[name]} if name in design.factors else {*design.trials.get(name, ())}
        if given - {*levels}:
            yield f"[design] {name}: found {', '.join(sorted(given))}, expected levels from {', '.join(levels)}"
        if name in design.values and len(design.values[name]) != len(levels):
            found = len(design.values[name])
            yield f"[design] values.{name}: found {found}, expected one for each of {len(levels)} levels"


def _of_force(block: Block, physics: Physics) -> Iterator[str]:
    """Find force settings that agents cannot compute: they know only their own coupling."""
    if physics.coupling_at != "both" or not block.haptics:
        return
    needs: dict[str, tuple[bool, str]] = {
        "force": (CONDITIONS[block.force].local, " or ".join(f'"{name}"' for name in FORCES if CONDITIONS[name].local)),
        "force_scale": (block.force_scale == 1.0, "1"),
        "force_delay_ms": (block.force_delay_ms == 0, "0"),
        "catch": (not block.catch, "none"),
        "trial_scales": (not block.trial_scales, "none"),
        "left": (block.left == "person", '"person"'),
        "right": (block.right == "person", '"person"'),
    }
    for key, (fine, expected) in needs.items():
        if not fine:
            found = getattr(block, key)
            shown = f'"{found}"' if isinstance(found, str) else str(list(found) if isinstance(found, tuple) else found)
            yield f'[block] {key}: found {shown}, expected {expected} with [physics] coupling_at = "both"'


def _of_perturbation(config: Config) -> Iterator[str]:
    """Find perturbations that cannot act, or would be cut by a limit."""
    table, physics = config.perturbation, config.physics
    for key, numbers in (("trials", table.trials), ("opposite", table.opposite)):
        for trial in numbers:
            if not 1 <= trial <= MAX_TRIALS:
                yield f"[perturbation] {key}: found {trial}, expected numbers of trials, from 1 to {MAX_TRIALS}"
    if extra := sorted({*table.opposite} - {*table.trials}):
        yield f"[perturbation] opposite: found {extra[0]}, expected one of the numbers in trials"
    if table.at == "none":
        if table.trials:
            yield '[perturbation] at: found "none" with perturbation trials, expected a place'
        return
    if table.force == 0:
        yield '[perturbation] force: found 0, expected another force, or at = "none"'
    if (table.at == "ball" or table.onset == "ball") and physics.balls == 0:
        yield '[perturbation] at, onset: found "ball" without a ball, expected [physics] balls = 1'
    if table.at == "board" and physics.board == "hinged":
        yield '[perturbation] at: found "board", which cannot heave with [physics] board = "hinged"; expected "free"'
    if table.at in SIDES:
        yield from _of_pushed_stylus(config, table.at)


def _of_pushed_stylus(config: Config, side: Side) -> Iterator[str]:
    """Find reasons why a stylus cannot be pushed: a force passes the same way as haptic feedback."""
    table, block = config.perturbation, config.block
    where = f'[perturbation] at: found "{side}", '
    if not block.haptics or (block.force_scale == 0 and not block.trial_scales):
        yield f"{where}expected haptic feedback in the block, because agents render no force without it"
    if getattr(block, side) == "still":
        yield f"{where}expected a stylus that somebody holds ([block] {side})"
    if config.physics.coupling_at == "both":
        yield f'{where}expected [physics] coupling_at = "server", because agents compute the force otherwise'
    if both := sorted({*table.trials} & {*block.catch}):
        yield f"[perturbation] trials: found {both[0]}, which is a catch trial without force; expected another trial"
    if abs(table.force) > config.safety.max_force:
        yield (
            f"[perturbation] force: found {table.force:g}, expected at most {config.safety.max_force:g} N "
            "([safety] max_force)"
        )


def _of_sizes(geometry: Geometry, task: Task, physics: Physics) -> Iterator[str]:
    """Find contradictions between sizes and distances."""
    edge, half = geometry.board_length / 2, geometry.target_width / 2
    outer = geometry.target_distance + half
    if outer > edge:
        yield (
            f"[geometry] target_distance, target_width: the target ends {outer:g} m from the board's centre, "
            f"expected within the board, which ends at {edge:g} m"
        )
    if 2 * geometry.target_distance <= half:
        yield (
            f"[geometry] target_distance: found {geometry.target_distance:g}, expected more than {half / 2:g} m, "
            "so that the ball does not start inside the target"
        )
    if physics.l > edge:
        yield f"[physics] l: found {physics.l:g}, expected a control point on the board, at most {edge:g} m"
    if task.fall_distance < outer:
        yield (
            f"[task] fall_distance: found {task.fall_distance:g}, expected at least {outer:g} m, the target's far edge"
        )
    if task.fall_distance > edge + geometry.ball_radius:
        yield (
            f"[task] fall_distance: found {task.fall_distance:g}, expected at most {edge + geometry.ball_radius:g} m, "
            "where the ball has left the board"
        )
    if task.stylus_range >= physics.l:
        yield (
            f"[task] stylus_range: found {task.stylus_range:g}, expected less than {physics.l:g} m ([physics] l), "
            "or the board could stand upright"
        )
    if 0 < physics.ball_stop < geometry.target_distance:
        yield (
            f"[physics] ball_stop: found {physics.ball_stop:g}, expected at least {geometry.target_distance:g} m "
            "([geometry] target_distance), or the ball could not reach the target; 0 for no stops"
        )
    if task.level_height > task.stylus_range:
        yield (
            f"[task] level_height: found {task.level_height:g}, expected at most {task.stylus_range:g} m "
            "([task] stylus_range)"
        )


def _of_safety(safety: Safety) -> Iterator[str]:
    """Find contradictions between safety limits."""
    between = HEARTBEAT_TICKS * TICK_SECONDS * 1e3
    if safety.stale_after_ms <= between:
        yield (
            f"[safety] stale_after_ms: found {safety.stale_after_ms:g}, expected more than {between:g} ms, the time "
            "between two heartbeats of the server without haptic feedback"
        )
    if safety.disarm_after_ms < safety.stale_after_ms + safety.fade_ms:
        yield (
            f"[safety] disarm_after_ms: found {safety.disarm_after_ms:g}, expected at least "
            f"{safety.stale_after_ms + safety.fade_ms:g} ms, the time a stale force takes to begin and end its fade"
        )
    if safety.arm_gate > safety.max_force:
        yield f"[safety] arm_gate: found {safety.arm_gate:g}, expected at most {safety.max_force:g} N (max_force)"
