"""Configuration: one TOML text for rig and experiment, validated and parsed into frozen dataclasses.

Every default is the paper's. Every quantity is in SI units and says so in its metadata, from which error messages, the
commented template of ``netboard config init`` and the documentation are made. An unknown key, a wrong type or a value
out of range is a `ConfigError` that names source, table and key and says what was expected.

This module parses text; it opens no file (the services do), so the pure part may import the dataclasses.
"""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal

from pydantic import TypeAdapter

from netboard.base.errors import ConfigError
from netboard.base.settings import FORBID_UNKNOWN_KEYS, read, write, write_template
from netboard.base.tables.contradictions import of_block, of_design, of_force, of_safety, of_scene, of_sizes
from netboard.base.tables.experiment import Block, Design, Quality, Session, Task
from netboard.base.tables.rig import MOUSE, Agents, Display, Fixture, Network, Realtime, Recording, Safety
from netboard.base.tables.scene import Geometry, Physics
from netboard.base.tables.simulated import Participant, VirtualDevice

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
    design: Design = field(default_factory=Design)
    quality: Quality = field(default_factory=Quality)
    task: Task = field(default_factory=Task)
    physics: Physics = field(default_factory=Physics)
    geometry: Geometry = field(default_factory=Geometry)
    network: Network = field(default_factory=Network)
    realtime: Realtime = field(default_factory=Realtime)
    safety: Safety = field(default_factory=Safety)
    fixture: Fixture = field(default_factory=Fixture)
    agents: Agents = field(default_factory=Agents)
    virtual: VirtualDevice = field(default_factory=VirtualDevice)
    participant: Participant = field(default_factory=Participant)
    display: Display = field(default_factory=Display)
    recording: Recording = field(default_factory=Recording)


ADAPTER: TypeAdapter[Config] = TypeAdapter(Config)


def parse(text: str, source: str = "netboard.toml", overrides: Sequence[str] = ()) -> Config:
    """Validate a TOML text and parse it into a `Config`.

    Parameters
    ----------
    text : str
        The TOML text; missing tables and keys take their defaults.
    source : str
        Name of the file, for error messages.
    overrides : sequence of str
        Settings as ``table.key=value`` that take precedence over those of the text.

    Returns
    -------
    Config
        The configuration.

    Raises
    ------
    ConfigError
        If the text is not TOML, a key is unknown, of the wrong type or out of range, or two keys contradict each
        other. The message has a line for every problem.
    """
    config = read(ADAPTER, Config, text, source, overrides)
    origin = f"{source} with --set" if overrides else source
    problems = [f"{origin}: {problem}" for problem in contradictions(config)]
    if problems:
        raise ConfigError("\n".join(problems))
    return config


def resolve(config: Config) -> str:
    """Write a configuration in full.

    Parameters
    ----------
    config : Config
        The configuration.

    Returns
    -------
    str
        TOML text with every key; `parse` returns an equal configuration, to the last bit.
    """
    return write(config)


def template() -> str:
    """Write the defaults with a comment at every key, as a template.

    Returns
    -------
    str
        TOML text.
    """
    return TEMPLATE_HEAD + write_template(Config)


def played_sides(config: Config) -> tuple[Side, ...]:
    """Return the sides that are played in their display's window.

    Parameters
    ----------
    config : Config
        The configuration.

    Returns
    -------
    tuple of {"left", "right"}
        Those whose device is the mouse.
    """
    agents = {"left": config.agents.left, "right": config.agents.right}
    return tuple(side for side in SIDES if agents[side].device == MOUSE)


def digest(config: Config) -> str:
    """Return the hash of a configuration; equal configurations have equal hashes.

    Parameters
    ----------
    config : Config
        The configuration.

    Returns
    -------
    str
        SHA-256 of the resolved text, in hexadecimal.
    """
    return hashlib.sha256(resolve(config).encode()).hexdigest()


def contradictions(config: Config) -> Iterator[str]:
    """Find keys that are valid by themselves and contradict each other.

    Parameters
    ----------
    config : Config
        The configuration.

    Yields
    ------
    str
        One sentence for each, with table, key, value and the expected value.
    """
    yield from of_scene(config.physics)
    yield from of_block(config.block)
    yield from of_design(config.design)
    yield from of_force(config.block, config.physics)
    yield from of_sizes(config.geometry, config.task, config.physics)
    yield from of_safety(config.safety)
