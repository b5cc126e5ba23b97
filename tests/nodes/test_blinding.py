"""What a session of each kind of partner tells its operators and participants, if its blocks are blinded."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import pytest
from stepped_session import SteppedSession

import rehearsed
from made_network import noted_text
from netboard.base.config import SIDES, Config, parse, resolve
from netboard.base.device_kind import SEATED
from netboard.base.tables.experiment import PERSON, STILL
from netboard.base.tables.questionnaires import ANSWERS, PERSON_FORM, Form, packed
from netboard.devices.simulated.partner import RobotPartner
from netboard.network.protocol.codec import encode
from netboard.network.protocol.joining import Hello
from netboard.network.protocol.records import AGENT_JOINED, AGENT_PRESENT
from netboard.network.protocol.views import QuestionnaireAnswers
from netboard.network.transport import sockets
from netboard.nodes.agent.agent import introduction
from netboard.nodes.ports import latency
from netboard.nodes.ports.welcomes import texts_of, unblinded
from netboard.nodes.server.answers import SessionAnswers
from netboard.nodes.server.event_log import line_of
from netboard.nodes.server.questionnaires import Questionnaires
from netboard.participants.seat.partners import POLICIES
from netboard.stage.blinding import ABOUT_FORMS, ANOTHER_HOLDER, for_display, for_operator, shown_details
from netboard.task.trials.state_machine import Phase

KINDS = (PERSON, STILL, *POLICIES)
"""Every kind of partner: a person, a hand that is held still, and each robot partner of the registry."""

ROBOTS = tuple(POLICIES)

STUDY = """
name = "pairs"
block.trials = 1
block.blinded = {blinded}
block.first_target = "left"
[orders]
main = "2 {kind}-block"
[factors.partner]
order = "alternate"
levels.{kind}.other_hand = "{kind}"
levels.{kind}_again.other_hand = "{kind}"
[kinds.{kind}-block]
performers = "A"
"""


def own_device(side: str) -> Hello:
    """How an agent with a haptic device introduces itself."""
    details = {"device": "falcon", "kind": "haptic", "model": "Falcon", "serial": "7", latency.DELAY_LIMIT: "9 ms"}
    return Hello("agent", side, 1, "station:17", "1.0", details)


def partner_device(kind: str, config: Config) -> Hello:
    """How an agent introduces itself that has seated the robot partner of a block."""
    agent = replace(config.agents.right, device="partner", options={"partner": kind})
    config = replace(config, agents=replace(config.agents, right=agent))
    device = RobotPartner("right", config)
    device.open()
    hello = introduction("right", config, device.info, {**device.identity, SEATED: "true"})
    device.close()
    return replace(hello, name="station:17", protocol=1, version="1.0")


class Told(NamedTuple):
    """All that a session has told, except what differs between any two sessions, such as ages and ports."""

    configurations: dict[str, str]
    statuses: list[bytes]
    lines: list[str]


@pytest.fixture(scope="module")
def recorded_hand(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return rehearsed.write(tmp_path_factory.mktemp("hand") / "block.mcap", rehearsed.rows())


@pytest.fixture
def told(recorded_hand: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> Iterator[Callable[..., Told]]:
    """Runs a session of a kind of partner."""
    with sockets.open_context() as context:

        def run(kind: str, *, blinded: bool = True) -> Told:
            caplog.clear()
            folder = tmp_path / f"{kind}-{blinded}"
            folder.mkdir()
            study = STUDY.format(kind=kind, blinded=str(blinded).lower())
            with caplog.at_level(logging.INFO):
                settings = f"partners.right.file={recorded_hand}", "partners.right.hand=right"
                session = SteppedSession(folder, context, *(settings if kind == "playback" else ()), study=study)
                return _play(session, kind, caplog)

        yield run


def _play(session: SteppedSession, kind: str, caplog: pytest.LogCaptureFixture) -> Told:
    """Play two blocks of a session in which both agents join, and that of the right seats the partner."""
    state, statuses = session.state, []
    state.ports.motion.expire = lambda now_ns: None  # type: ignore[method-assign]
    for side in SIDES:
        _join(session, own_device(side))
    if kind in ROBOTS:
        state.note("agent_left", {"side": "right", "reason": ANOTHER_HOLDER})
        _join(session, partner_device(kind, state.block.config))
    for block in (1, 2):
        texts = state.ports.control._welcomes
        statuses.append(_status(session))
        session.start()
        session.succeed()
        session.until(Phase.FINISHED)
        statuses.append(_status(session))
        if block == 1:
            assert session.do("next")[0]
            session.tick(2)
    session.close()
    shown = state.block.texts.shown
    assert set(texts) == set(shown)
    lines = [
        one.getMessage()
        for one in caplog.records
        if one.name.startswith("netboard")
        and not one.getMessage().startswith(("session_started", "stood_still"))
        and one.levelno == logging.INFO
    ]
    return Told({name: _comparable(text) for name, text in shown.items()}, statuses, lines)


def _join(session: SteppedSession, hello: Hello) -> None:
    session.state.ports.motion.agents["left" if hello.side == "left" else "right"].hello = hello
    own = {"side": hello.side, "name": hello.name}
    session.state.note(AGENT_JOINED, {**hello.details, **own})


def _status(session: SteppedSession) -> bytes:
    """The status in the form in which it is sent, without what is measured, such as ages, forces and lost samples."""
    session.state.missing = session.state.find_missing()
    status = SessionAnswers(session.state).status()
    status = replace(
        status,
        session="",
        rest=0.0,
        links=(),
        stations=(),
        lost=(),
        completions=tuple(0.0 for _ in status.completions),
    )
    return encode(status)


def _comparable(text: str) -> str:
    """A configuration without the port and the folder of its session."""
    config = parse(text)
    return resolve(replace(config, network=type(config.network)(), recording=type(config.recording)()))


@pytest.mark.parametrize("kind", ROBOTS)
def test_displays_and_operators_are_told_the_same_of_a_robot_as_of_a_person(
    kind: str, told: Callable[..., Told]
) -> None:
    robot, person = told(kind), told(PERSON)
    assert robot.statuses == person.statuses
    for name in ("console", "trigger", "display.left"):
        assert robot.configurations[name] == person.configurations[name], name
    assert robot.lines == person.lines


def test_hand_held_still_is_not_told_from_a_person(told: Callable[..., Told]) -> None:
    still, person = told(STILL), told(PERSON)
    assert still.lines == person.lines
    assert still.statuses == person.statuses
    for name in ("console", "trigger", "display.left"):
        assert still.configurations[name] == person.configurations[name], name


@pytest.mark.parametrize("kind", ROBOTS)
def test_away_display_is_told_the_same_of_every_robot(kind: str, told: Callable[..., Told]) -> None:
    assert told(kind).configurations["display.right"] == told(STILL).configurations["display.right"]


@pytest.mark.parametrize("kind", ROBOTS)
def test_participants_are_not_told_of_the_robot_in_a_block_that_is_not_blinded(
    kind: str, told: Callable[..., Told]
) -> None:
    robot, person = told(kind, blinded=False), told(PERSON, blinded=False)
    assert robot.configurations["display.left"] == person.configurations["display.left"]
    assert f'right = "{kind}"' in robot.configurations["console"]
    assert any(kind in line for line in robot.lines)


def test_recording_has_all_of_a_blinded_block(tmp_path: Path) -> None:
    with sockets.open_context() as context:
        session = SteppedSession(tmp_path, context, study=STUDY.format(kind="leader", blinded="true"))
        session.state.ports.motion.expire = lambda now_ns: None  # type: ignore[method-assign]
        _join(session, partner_device("leader", session.state.block.config))
        session.start()
        session.succeed()
        events = {one.name: one.details for one in session.events()}
        session.close()
    config = parse(events["block_began"]["config"])
    assert (config.block.right, config.block.blinded) == ("leader", True)
    assert config.design.factors["partner"].startswith("leader")
    assert events[AGENT_JOINED]["partner"] == "leader"
    assert any("factor_partner" in details for details in events.values())


def test_events_of_answers_and_of_their_absence_have_no_line() -> None:
    form = Form(tuple(packed("person", name, question) for name, question in PERSON_FORM.items()), wait=60.0)
    config = replace(parse("[block]\nblinded = true\nright = 'lqg'\n"), form=form)
    forms = Questionnaires()
    forms.ask(config)
    assert forms.notice.startswith("questionnaire: waiting for the participants, ")
    details = forms.take(QuestionnaireAnswers("left", 1, {"person.opinion": "a person"}, 3.0, False))
    assert details["partner"] == "lqg"
    assert shown_details(ANSWERS, details) is None
    assert shown_details("questionnaire_unanswered", {"station": "left", "block": "1"}) is None


@pytest.mark.parametrize("event", [AGENT_JOINED, AGENT_PRESENT])
def test_line_of_an_agent_has_its_side_and_name_only(event: str) -> None:
    details = {"side": "right", "name": "station:17", "partner": "lqg", "policy_sha256": "12"}
    shown = shown_details(event, details)
    assert shown is not None
    assert line_of(event, shown) == f"{event} side=right name=station:17"


def test_names_of_events_are_those_of_the_session() -> None:
    assert shown_details(latency.DELAY_LIMIT, {"limit": "3 ms"}) is None
    assert shown_details("agent_left", {"side": "right", "reason": "fell silent"}) is not None
    assert shown_details("agent_left", {"side": "right", "reason": ANOTHER_HOLDER}) is None


def test_display_is_told_of_a_still_hand_unless_the_block_is_blinded() -> None:
    open_block, blinded = (parse(f"[block]\nright = 'still'\nblinded = {word}\n") for word in ("false", "true"))
    assert for_display(open_block, "left").block.right == STILL
    assert for_display(blinded, "left").block.right == PERSON


@pytest.mark.parametrize("movers", [("person", "lqg"), ("leader", "still"), ("lqg", "game"), ("still", "person")])
def test_configurations_for_displays_and_operators_are_valid(movers: tuple[str, str]) -> None:
    left, right = movers
    for word in ("true", "false"):
        config = parse(f"[block]\nleft = '{left}'\nright = '{right}'\nblinded = {word}\n")
        for side in SIDES:
            shown = for_display(config, side)
            assert parse(resolve(shown)) == shown
            assert (getattr(shown.block, side) == PERSON) == (getattr(config.block, side) == PERSON)
        assert parse(resolve(for_operator(config))) == for_operator(config)


def test_display_keeps_its_own_device_and_learns_of_no_push() -> None:
    text = "[agents.left]\ndevice = 'mouse'\n[agents.right]\ndevice = 'falcon'\n"
    text += "[perturbation]\nat = 'right'\nforce = 1.0\ntrials = [1]\n"
    shown = for_display(parse(text), "left")
    assert (shown.agents.left.device, shown.agents.right.device) == ("mouse", Config().agents.right.device)
    assert shown.perturbation == Config().perturbation


def test_console_of_a_replay_is_told_all() -> None:
    config = parse("[block]\nblinded = true\nright = 'lqg'\n")
    text = resolve(config)
    assert unblinded(config, text).shown["console"] == text
    assert unblinded(config, text).shown["display.left"] == texts_of(config).shown["display.left"] != text


@pytest.mark.parametrize("blinded", [True, False])
def test_block_waits_for_the_partner_of_the_study_not_only_for_its_name(tmp_path: Path, blinded: bool) -> None:
    """Another file of weights at the agent, or parameters of the block before, make it another partner."""
    study = STUDY.format(kind="learned", blinded=str(blinded).lower())
    with sockets.open_context() as context:
        session = SteppedSession(tmp_path, context, study=study)
        session.state.ports.motion.expire = lambda now_ns: None  # type: ignore[method-assign]
        config = session.state.block.config
        (tmp_path / "other.json").write_text(noted_text("other"))
        other = {"weights": str(tmp_path / "other.json")}
        _join(session, partner_device("learned", replace(config, partners=replace(config.partners, right=other))))
        words = "the right agent" + " to seat the robot partner learned with the parameters and files of the server" * (
            not blinded
        )
        assert words in session.state.find_missing()
        _join(session, partner_device("learned", config))
        assert not [words for words in session.state.find_missing() if "right agent" in words]
        session.close()


@pytest.mark.parametrize("name", ABOUT_FORMS)
def test_events_about_forms_have_no_line_in_a_session_with_a_blinded_block(
    name: str, caplog: pytest.LogCaptureFixture, stepped: SteppedSession
) -> None:
    """They may be about an earlier block than the present one, which is not blinded."""
    events = stepped.state.event_log
    caplog.set_level(logging.INFO)
    for hidden in (False, True):
        caplog.clear()
        events.any_blinded = hidden
        events.note(1, name, {"station": "left", "block": "1", "complete": "false"})
        assert (f"{name} station=left" in caplog.text) is not hidden


@pytest.mark.parametrize("blinded", [True, False])
def test_block_of_a_person_waits_until_the_agent_serves_its_own_device_again(tmp_path: Path, blinded: bool) -> None:
    """Else it would begin with the robot partner of the block before, and operators would see that there was one."""
    study = STUDY.format(kind=PERSON, blinded=str(blinded).lower())
    with sockets.open_context() as context:
        session = SteppedSession(tmp_path, context, study=study)
        state = session.state
        state.ports.motion.expire = lambda now_ns: None  # type: ignore[method-assign]
        _join(session, partner_device("leader", state.block.config))
        words = "the right agent" + " to return to its own device" * (not blinded)
        assert words in state.find_missing()
        assert not [one for one in (*state.shown_stand_ins(), *state.find_stand_ins()) if "right" in one]
        own = own_device("right")
        _join(session, replace(own, details={**own.details, "kind": "simulated"}))
        assert words not in state.find_missing()
        assert "right device simulated" in state.shown_stand_ins()
        session.close()
