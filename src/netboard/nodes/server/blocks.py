"""The blocks of a session, prepared before its first tick so that nothing is compiled while a hand holds a stylus."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from netboard.base.config import SIDES, Config, Side
from netboard.base.errors import ConfigError, RecordingError
from netboard.base.tables.experiment import PERSON, STILL, Session
from netboard.nodes.ports import samples
from netboard.nodes.ports.latency import LatencySupervisor
from netboard.nodes.ports.welcomes import BlockTexts, texts_of
from netboard.nodes.server.server_runs import run_of
from netboard.nodes.server.still_hand import fill_still
from netboard.participants.policy import SIMULATED_PARTICIPANT, Policy
from netboard.participants.seat.partners import partners_of
from netboard.recording.files.reader import Recording
from netboard.stage.curtain import Curtain, make_curtain
from netboard.stage.stage import Stage, make_stage
from netboard.task.trials.unrelated import Unrelated, unrelated_of


@dataclass(frozen=True, slots=True)
class PreparedBlock:
    """A block that can begin at any moment."""

    config: Config
    texts: BlockTexts
    stage: Stage
    curtain: Curtain
    latency: LatencySupervisor  # blocks with the same scene share it
    ends: Any
    people: tuple[Side, ...]  # sides of persons
    moved: tuple[Side, ...]  # sides whose hand an agent moves: those of persons and of robot partners
    partners: Mapping[Side, str]  # the SHA-256 of each robot partner's identity, if the server knows it
    still: tuple[Side, ...]  # sides whose hand is held still
    unrelated: Unrelated | None
    run: Callable[..., int] | None  # its undisturbed ticks, if the block can have some

    def stand_in(self, row: np.void, words: NDArray[np.int64], number: int, due_ns: int, state: Any) -> int:
        """Fill in the inputs of a tick that come from no agent.

        Return the `samples.LIVE` and `samples.ARMED` bits of the hands that are held still.
        """
        found = 0
        for side in self.still:
            fill_still(words, side, number, due_ns)
            found |= (samples.LIVE | samples.ARMED) << SIDES.index(side)
        if self.unrelated is not None:
            row["left_other"], row["right_other"] = self.unrelated.at(state)
        return found


class BlockSequence:
    """The blocks of a session in order, and the current one.

    ``remake``: re-creates the configurations for a completed form; None for a session without a form.
    """

    def __init__(
        self, configs: Sequence[Config], remake: Callable[[Session], Sequence[Config]] | None = None, place: int = 0
    ) -> None:
        self._supervisors: dict[Any, LatencySupervisor] = {}
        self._blocks = [_prepared(config, self._supervisors) for config in configs]
        self._remake = remake
        self._place = place
        self.block = self._blocks[place]

    @property
    def last(self) -> bool:
        """Whether the current block is the last one."""
        return self._place + 1 == len(self._blocks)

    @property
    def any_blinded(self) -> bool:
        """Whether any block of the session is blinded."""
        return any(block.config.block.blinded for block in self._blocks)

    def ahead(self, count: int) -> list[Config]:
        """Return the configurations of the next blocks, at most `count`."""
        return [block.config for block in self._blocks[self._place + 1 : self._place + 1 + count]]

    @property
    def planned(self) -> bool:
        """Whether the session follows a plan, rather than being a single block."""
        return self._remake is not None

    def next(self) -> PreparedBlock:
        """Go on to the next block."""
        self._place += 1
        self.block = self._blocks[self._place]
        return self.block

    def open(self, session: Session) -> None:
        """Prepare all blocks again for the session that its form describes."""
        assert self._remake is not None
        self._blocks = [_prepared(config, self._supervisors) for config in self._remake(session)]
        self.block = self._blocks[self._place]


def _prepared(config: Config, supervisors: dict[Any, LatencySupervisor]) -> PreparedBlock:
    stage = make_stage(config)
    stage.warm()
    movers = {side: getattr(config.block, side) for side in SIDES}
    still = tuple(side for side in SIDES if movers[side] == STILL)
    scene = config.physics, config.virtual, config.network.delay_action
    if scene not in supervisors:
        supervisors[scene] = LatencySupervisor(config)
    both = config.physics.coupling_at == "both"
    plain = not (still or config.block.unrelated or both)
    return PreparedBlock(
        config=config,
        texts=texts_of(config),
        stage=stage,
        curtain=make_curtain(config),
        latency=supervisors[scene],
        ends=samples.ends_of(config.physics) if both else None,
        people=tuple(side for side in SIDES if movers[side] == PERSON),
        moved=tuple(side for side in SIDES if side not in still),
        partners={side: _sha256_of(partner) for side, partner in partners_of(config).items()},
        still=still,
        unrelated=unrelated_in(config.block.unrelated) if config.block.unrelated else None,
        run=run_of(stage) if plain else None,
    )


def _sha256_of(partner: Policy) -> str:
    """Return the SHA-256 of a partner's identity; empty for a simulated participant, whose table is the agent's own."""
    return "" if partner.kind == SIMULATED_PARTICIPANT else partner.identity.get("policy_sha256", "")


def unrelated_in(path: str) -> Unrelated:
    """Read the forces of another session's recording."""
    try:
        with Recording(Path(path)) as recording:
            return unrelated_of(recording.ticks(), path)
    except (OSError, RecordingError) as error:
        raise ConfigError(f'[block] unrelated: found "{path}", which cannot be read: {error}') from None
