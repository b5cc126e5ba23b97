"""All blocks of a dyad by a study, a configuration each; and fewer of them, for a trial run."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

from netboard.config import Config
from netboard.design.plan import config_of, plan_of, seated
from netboard.design.study import Study


def blocks_of(config: Config, study: Study, seed: int, dyad: int) -> list[Config]:
    """Plan the blocks of a dyad, session after session.

    Parameters
    ----------
    config : Config
        The rig's.
    study : Study
        The study.
    seed : int
        Seed of the plan [1].
    dyad : int
        Number of the dyad, from 1 [1].

    Returns
    -------
    list of Config
        One for each block, with names of the session and the dyad.

    Raises
    ------
    ConfigError
        If the study does not fit the rig.
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
    blocks : sequence of Config
        The blocks.
    most : int or None
        How many are kept; None for all [1].
    trials : int or None
        How many trials each has at most; None for as many as it has [1].

    Yields
    ------
    Config
        The next block.
    """
    kept = blocks[:most]
    for config in kept:
        count = config.block.trials if trials is None else min(trials, config.block.trials)
        catch = tuple(trial for trial in config.block.catch if trial <= count)
        yield replace(config, block=replace(config.block, blocks=len(kept), trials=count, catch=catch))
