"""The configurations of all blocks of a dyad, or of a shortened run."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from netboard.base.config import Config
from netboard.task.plans.plan import config_of, plan_of, seated
from netboard.task.studies.study import Study


def blocks_of(config: Config, study: Study, seed: int, dyad: int) -> list[Config]:
    """Return the configuration of each block of a dyad, in order, with the names of session and dyad."""
    plan = plan_of(study, seed, dyad, (config.session.hand_a, config.session.hand_b))
    rig = seated(config, plan)
    return [
        config_of(
            replace(rig, session=replace(rig.session, name=f"S{session.number:02d}", dyad=f"D{dyad:02d}")),
            session,
            block.number,
        )
        for session in plan.sessions
        for block in session.blocks
    ]


def shortened(blocks: Sequence[Config], most: int | None, trials: int | None) -> Iterator[Config]:
    """Yield only the first blocks, with fewer trials each.

    Parameters
    ----------
    most : int or None
        Number of blocks to keep; None for all [1].
    trials : int or None
        Most trials per block; None for no limit [1].
    """
    kept = blocks[:most]
    for config in kept:
        count = config.block.trials if trials is None else min(trials, config.block.trials)
        catch = tuple(trial for trial in config.block.catch if trial <= count)
        yield replace(config, block=replace(config.block, blocks=len(kept), trials=count, catch=catch))
