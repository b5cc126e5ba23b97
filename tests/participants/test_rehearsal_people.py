"""Simulated participants differ, stay the same over blocks, and see no more than they may."""

from dataclasses import asdict, fields, replace

import numpy as np
import pytest

from netboard.base.config import Config
from netboard.base.tables.simulated import PARTICIPANT_SOURCES, Participant
from netboard.participants.people.person import ParticipantPolicy
from netboard.participants.people.population import VARIED, people_of, performers, person_of
from netboard.participants.seat.closed_loop import Seat, is_shown, make_seat, scale_in, seats_of
from netboard.task.trials.state_machine import Phase


def seat(config: Config, station: str, sides: tuple[str, ...]) -> Seat:
    return make_seat(config, ParticipantPolicy(config, config.participant, sides), station, (1,))


def test_simulated_participant_is_deterministic() -> None:
    assert person_of(Participant(), 1, 3, "A") == person_of(Participant(), 1, 3, "A")


def test_simulated_participants_differ_by_seed_dyad_and_letter() -> None:
    people = [person_of(Participant(), seed, dyad, letter) for seed in (1, 2) for dyad in (1, 2) for letter in "AB"]
    assert len({repr(person) for person in people}) == len(people)


def test_varied_parameters_are_spread_around_their_defaults() -> None:
    people = [asdict(person_of(Participant(), 1, dyad, "A")) for dyad in range(1, 401)]
    for name, default in asdict(Participant()).items():
        if isinstance(default, str) or default == 0.0:
            assert {person[name] for person in people} == {default}
            continue
        factors = np.log([person[name] / default for person in people])
        assert abs(factors.mean()) < 0.03
        assert factors.std() < 0.18
    assert np.std([person["threshold_deg"] for person in people]) > 0.1


def blocks() -> list[Config]:
    """A alone, B alone, both, A alone."""
    default = Config()
    kinds = [("bimanual", "A"), ("bimanual", "B"), ("dyadic", "A"), ("bimanual", "A")]
    return [
        replace(default, block=replace(default.block, configuration=kind, performer=letter, trials=10 * (k + 1)))
        for k, (kind, letter) in enumerate(kinds)
    ]


def test_practice_counts_the_trials_of_earlier_own_blocks() -> None:
    people = list(people_of(blocks(), 1, 1))
    assert [block_people["A"].practice for block_people in people] == [0, 10, 10, 40]
    assert [block_people["B"].practice for block_people in people] == [0, 0, 20, 50]
    assert {replace(block_people["A"], practice=0, acquaintance=0, felt_trials=0) for block_people in people} == {
        replace(person_of(Participant(), 1, 1, "A"), practice=0, acquaintance=0, felt_trials=0)
    }


def test_acquaintance_counts_the_dyadic_trials_before() -> None:
    for letter in "AB":
        assert [block_people[letter].acquaintance for block_people in people_of(blocks(), 1, 1)] == [0, 0, 0, 30]


@pytest.mark.parametrize(("force", "felt"), [("full", 30), ("none", 0), ("environment_only", 0)])
def test_only_trials_with_the_full_force_teach_to_read_it(force: str, felt: int) -> None:
    plan = [replace(config, block=replace(config.block, force=force)) for config in blocks()]
    people = list(people_of(plan, 1, 1))
    assert [one["A"].felt_trials for one in people] == [0, 0, 0, felt]
    assert people[3]["A"].acquaintance == 30


def test_configured_practice_is_kept() -> None:
    trained = [replace(config, participant=Participant(practice=500.0)) for config in blocks()]
    assert {block_people[letter].practice for block_people in people_of(trained, 1, 1) for letter in "AB"} == {500.0}


def test_robot_and_fixed_partner_are_not_performers() -> None:
    config = Config()
    swapped = replace(config, session=replace(config.session, seat_a="right"))
    assert performers(config) == ("A", "B")
    assert performers(replace(config, block=replace(config.block, left="robot"))) == ("B",)
    assert performers(replace(swapped, block=replace(config.block, left="still"))) == ("A",)


def test_views_arrive_at_the_view_rate() -> None:
    config = Config()
    slow = replace(config, network=replace(config.network, view_rate_hz=50.0))

    def shown(config: Config, side: str) -> list[int]:
        timing = seat(config, side, (side,)).timing
        return [tick for tick in range(30) if is_shown(timing, tick)]

    assert shown(config, "left") == [0, 9, 18, 27]
    assert shown(config, "right") == [4, 13, 22]
    assert shown(slow, "left") == [0, 20]


def test_force_is_informative_only_with_full_haptic_feedback() -> None:
    phase = Phase.RUNNING

    def is_informative(sides: tuple[str, ...] = ("left",), **keys: object) -> bool:
        config = Config()
        observer = seat(replace(config, block=replace(config.block, **keys)), "left", sides)
        return scale_in(observer, 3, int(phase)) > 0.0

    assert is_informative()
    assert is_informative(force_scale=0.5)
    assert not is_informative(force="none")
    assert not is_informative(force="partner_only")
    assert not is_informative(force_scale=0.0)
    assert not is_informative(catch=(1, 3))
    assert not is_informative(("left", "right"))
    phase = Phase.PAUSED
    assert not is_informative()


@pytest.mark.parametrize(
    ("keys", "seats"),
    [
        ({}, (("left", ("left",)), ("right", ("right",)))),
        ({"right": "still"}, (("left", ("left",)),)),
        ({"left": "robot"}, (("left", ("left",)), ("right", ("right",)))),
        ({"configuration": "bimanual", "station": "right"}, (("right", ("left", "right")),)),
    ],
)
def test_seats_of_deciding_participants(keys: dict[str, object], seats: object) -> None:
    config = Config()
    assert seats_of(replace(config, block=replace(config.block, **keys))) == seats


def test_every_parameter_has_a_source_and_every_varied_name_exists() -> None:
    names = [field.name for field in fields(Participant)]
    assert sorted(PARTICIPANT_SOURCES) == sorted(names)
    assert {name for group in VARIED for name in group} <= set(names)
