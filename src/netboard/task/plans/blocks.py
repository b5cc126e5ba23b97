"""All blocks of a dyad by a study, a configuration each; and fewer of them, for a trial run."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from netboard.base.config import Config
from netboard.task.plans.plan import config_of, plan_of, seated
from netboard.task.studies.study import Study


def blocks_of(config: Config, study: Study, seed: int, dyad: int) -> list[Config]:
    """Plan the blocks of a dyad, session after session.

    Returns
    -------
    list of Config
        One for each block, with names of the session and the dyad.
    """
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
    """Keep the first blocks only, with fewer trials each.

    Parameters
    ----------
    trials : int or None
        How many trials each has at most; None for as many as it has [1].
    """
    kept = blocks[:most]
    for config in kept:
        count = config.block.trials if trials is None else min(trials, config.block.trials)
        catch = tuple(trial for trial in config.block.catch if trial <= count)
        yield replace(config, block=replace(config.block, blocks=len(kept), trials=count, catch=catch))
