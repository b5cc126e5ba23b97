"""Lamps, texts and commands of the console for each status, without Qt."""

import io
import math
import re
from dataclasses import replace
from itertools import product

import pytest
from console_server import IDLE, MINE, RUNNING, STATES, UNARMED_LINK, attempts
from rich.console import Console

from netboard.base.config import SIDES, Config
from netboard.base.safeguards import Safeguard
from netboard.base.tables.experiment import Block, Session
from netboard.network.protocol import control
from netboard.network.protocol.control import FORM_AWAITED, REPLAY_OF, LinkStatus, LoopStatus, RecordingStatus, Status
from netboard.network.protocol.joining import HELLO_FIRST
from netboard.nodes.operator.status_table import status_tables
from netboard.nodes.ports.control_port import CommandRequest
from netboard.nodes.ports.emergency import AWAITING_ARMING, AWAITING_RELEASE, STOP
from netboard.nodes.ports.refusals import TOO_MANY_MESSAGES
from netboard.nodes.ports.waiting import in_words
from netboard.nodes.server.operators import Operators, Situation
from netboard.recording.format.disk import BYTES_PER_SECOND, SLOW_SYNC_S, STALLED_SYNC_S
from netboard.task.trials.exclusion import USUAL_RULE
from netboard.task.trials.state_machine import Phase
from netboard.windows.operator import words
from netboard.windows.operator.changes import RecentCounts, StatusHistory, minutes_left
from netboard.windows.operator.commands import COMMANDS, CONFIRMING, RELEASING, STOP_KEYS, refusal
from netboard.windows.operator.lamps import SESSION_LAMPS, LampLevel, alarm, ended, limits_of, session_lamps
from netboard.windows.operator.stations import STATION_LAMPS, station_lamps
from netboard.windows.operator.words import Tone

LIMITS = limits_of(Config(), MINE)
NONE = RecentCounts()


def of(lamps, name):
    return next(lamp for lamp in lamps if lamp.name == name)


def left(**changes: object):
    """Lamps of the left station, with some fields of its status changed."""
    link, station = RUNNING.links[0], RUNNING.stations[0]
    of_link = {name: changes.pop(name) for name in LinkStatus._fields if name in changes}
    station = station._replace(age=changes.pop("sample_age", station.age), **changes)
    status = replace(RUNNING, links=(link._replace(**of_link),), stations=(station,))
    return station_lamps(status, NONE, "left", LIMITS)


@pytest.mark.parametrize("status", STATES.values(), ids=STATES)
def test_every_status_has_the_same_lamps_with_tips_and_texts(status: Status) -> None:
    for side in SIDES:
        lamps = station_lamps(status, NONE, side, LIMITS)
        assert tuple(lamp.name for lamp in lamps) == STATION_LAMPS
        assert all(lamp.tip for lamp in lamps)
        assert all(lamp.words for lamp in lamps if lamp.level is not LampLevel.OFF)
    lamps = session_lamps(status, 0.0, NONE, LIMITS)
    assert tuple(lamp.name for lamp in lamps) == SESSION_LAMPS


@pytest.mark.parametrize(
    ("total", "recently", "level", "text"),
    [
        (0, 0, LampLevel.GOOD, "0 in total"),
        (9_999, 0, LampLevel.GOOD, "9999 in total"),
        (123_456, 0, LampLevel.GOOD, "123k in total"),
        (12_345_678, 0, LampLevel.GOOD, "12M in total"),
        (123_456, 3, LampLevel.WATCH, "3 in 10 s"),
        (123_456, 40_000, LampLevel.BAD, "40k in 10 s"),
    ],
)
def test_deadline_misses_fit_into_their_lamp(total: int, recently: int, level: LampLevel, text: str) -> None:
    counts = replace(NONE, late_ticks=recently)
    lamp = of(session_lamps(replace(RUNNING, late_ticks=total), 0.0, counts, LIMITS), "Deadline misses")
    assert (lamp.level, lamp.words) == (level, text)
    assert len(text) <= len("consent given")  # which fits into a lamp as wide
    assert f"{recently} in the last" in lamp.tip
    assert f"{total} in total" in lamp.tip


def test_all_lamps_are_good_without_a_fault() -> None:
    lamps = [*(lamp for side in SIDES for lamp in station_lamps(RUNNING, NONE, side, LIMITS))]
    lamps += session_lamps(RUNNING, 0.1, NONE, LIMITS)
    assert {lamp.level for lamp in lamps} == {LampLevel.GOOD}
    assert words.worst([("", lamp) for lamp in lamps]).words == ""


@pytest.mark.parametrize(
    ("name", "level", "text", "changes"),
    [
        ("Device", LampLevel.BAD, "lost", {"safeguards": int(Safeguard.DEVICE_LOST)}),
        ("Device", LampLevel.WATCH, "not ready", {"safeguards": int(Safeguard.NOT_READY)}),
        ("Device", LampLevel.WATCH, "v0.0.1", {"version": "0.0.1"}),
        ("Link", LampLevel.BAD, "silent", {"age": 0.2}),
        ("Link", LampLevel.WATCH, "500 Hz", {"rate": 500.0}),
        ("Round trip", LampLevel.WATCH, "1.20 ms", {"round_trip": 0.0012}),
        ("Round trip", LampLevel.WATCH, "unknown", {"round_trip": math.nan}),
        ("Clock", LampLevel.BAD, "unknown", {"clock_bound": math.nan}),
        ("Clock", LampLevel.BAD, "\u00b10.60 ms", {"clock_bound": 0.0006}),
        ("Clock", LampLevel.WATCH, "\u00b10.30 ms", {"clock_bound": 0.0003}),
        ("Sample", LampLevel.BAD, "none", {"sample_age": math.nan}),
        ("Sample", LampLevel.BAD, "60 ms old", {"sample_age": 0.06}),
        ("Sample", LampLevel.WATCH, "20 ms old", {"sample_age": 0.02}),
        ("Drops", LampLevel.WATCH, "1 drop", {"lost_ticks": 1}),
        ("Drops", LampLevel.WATCH, "3 drops", {"lost_ticks": 3}),
        ("Drops", LampLevel.BAD, "500 drops", {"lost_ticks": 500}),
        ("Force", LampLevel.WATCH, "AT LIMIT +0.31 N", {"safeguards": int(Safeguard.CLAMPED)}),
        ("Force", LampLevel.WATCH, "SLEW +0.31 N", {"safeguards": int(Safeguard.SLEWED)}),
        ("Force", LampLevel.WATCH, "LIMITED +0.31 N", {"clipped_ticks": 900}),
        ("Safety", LampLevel.BAD, "STOPPED", {"safeguards": int(Safeguard.STOPPED | Safeguard.STALE)}),
        ("Safety", LampLevel.BAD, "too fast", {"safeguards": int(Safeguard.TOO_FAST | Safeguard.ARMED)}),
        ("Safety", LampLevel.WATCH, "arming", {"safeguards": int(Safeguard.RAMPING | Safeguard.ARMED)}),
        ("Safety", LampLevel.WATCH, "not armed", {"safeguards": 0}),
    ],
)
def test_station_lamp_shows_the_level_and_text_of_a_fault(
    name: str, level: LampLevel, text: str, changes: dict[str, object]
) -> None:
    lamp = of(left(**changes), name)
    assert (lamp.level, lamp.words) == (level, text)


def test_tip_of_arming_states_no_duration_because_each_agent_sets_its_own() -> None:
    lamp = of(left(safeguards=int(Safeguard.RAMPING | Safeguard.ARMED)), "Safety")
    assert "second" not in lamp.tip
    assert not re.search(r"\d", lamp.tip)


def test_latency_lamp_compares_the_loop_latency_with_its_stable_limit() -> None:
    for late, level in (
        (0.002, LampLevel.GOOD),
        (0.005, LampLevel.WATCH),
        (0.009, LampLevel.BAD),
        (math.nan, LampLevel.OFF),
    ):
        status = replace(RUNNING, loops=(LoopStatus("agent.left", late, 0.0085),))
        assert of(station_lamps(status, NONE, "left", LIMITS), "Latency").level is level


def test_absent_device_is_bad_only_if_the_server_waits_for_it() -> None:
    status = STATES["waiting"]
    assert of(station_lamps(status, NONE, "right", LIMITS), "Device").level is LampLevel.BAD
    unneeded = replace(status, waiting_for=())
    assert of(station_lamps(unneeded, NONE, "right", LIMITS), "Device").level is LampLevel.OFF


def test_drops_and_deadline_misses_count_recent_ones_only() -> None:
    history = StatusHistory()
    now = replace(RUNNING, links=(RUNNING.links[0], UNARMED_LINK))
    recent = history.add(100.0, now)
    assert recent.lost == {"agent.left": 0, "agent.right": 0}
    more = replace(now, links=(RUNNING.links[0], UNARMED_LINK._replace(lost=45)), late_ticks=7)
    recent = history.add(104.0, more)
    assert (recent.lost["agent.right"], recent.late_ticks) == (4, 4)
    assert "4 drops" in of(station_lamps(more, recent, "right", LIMITS), "Drops").words
    for second in range(105, 130):
        recent = history.add(float(second), more)
    assert (recent.lost["agent.right"], recent.late_ticks) == (0, 0)
    assert history.add(131.0, replace(more, session="another", late_ticks=0)).late_ticks == 0


def test_server_lamp_and_advice_name_why_a_peer_is_refused_now() -> None:
    why = "the left side already has an agent: lab1:7"
    waiting = STATES["waiting"]
    history = StatusHistory()
    refused = (("motion", why, 25), ("motion", HELLO_FIRST, 60), ("motion", TOO_MANY_MESSAGES, 16))
    assert history.add(100.0, replace(waiting, refused=())).refused == ()
    recent = history.add(104.0, replace(waiting, refused=refused))
    assert recent.refused == (why,)
    lamp = of(session_lamps(waiting, 0.0, recent, LIMITS), "Server")
    assert (lamp.level, lamp.words) == (LampLevel.WATCH, "refuses a peer")
    assert why in lamp.tip
    assert f"; the server refuses a peer: {why}" in words.advice(waiting, "", recent.refused).words
    assert why not in words.advice(IDLE, "", recent.refused).words
    for second in range(105, 116):
        recent = history.add(float(second), replace(waiting, refused=refused))
    assert recent.refused == ()
    assert of(session_lamps(waiting, 0.0, recent, LIMITS), "Server").level is LampLevel.GOOD


def test_minutes_left_on_the_disk_follow_the_growth_of_the_recording() -> None:
    assert minutes_left([(0.0, 0), (60.0, 60_000_000)], 600_000_000) == pytest.approx(10.0)
    assert minutes_left([(0.0, 9), (30.0, 30_000_000), (60.0, 31_000_000)], 31_000_000) == pytest.approx(1.0)
    assert minutes_left([(0.0, 90_000_000), (60.0, 60_000_000)], 60_000_000) == pytest.approx(1.0)


def test_minutes_left_on_the_disk_are_those_of_running_trials_while_nothing_is_known() -> None:
    hour = 3600 * BYTES_PER_SECOND
    for written in ([(0.0, 5)], [(0.0, 5), (60.0, 5)], [(0.0, 0), (60.0, 100_000)], [(0.0, 0), (3.0, 10**8)]):
        assert minutes_left(written, hour) == pytest.approx(60.0)


def test_status_history_estimates_the_minutes_left_from_growth() -> None:
    history = StatusHistory()
    for second in range(41):
        grown = (RecordingStatus("file", 0.1, 1_000_000 * second, 12 * 60 * 10**6),)
        recent = history.add(float(second), replace(RUNNING, recordings=grown))
    assert recent.minutes == pytest.approx(12.0)
    lamp = of(session_lamps(replace(RUNNING, recordings=grown), 0.0, recent, LIMITS), "Disk")
    assert (lamp.level, lamp.words) == (LampLevel.BAD, "12 min, 720.0 MB")
    assert math.isnan(history.add(42.0, replace(RUNNING, recordings=())).minutes)


@pytest.mark.parametrize(
    ("age", "level", "said"),
    [
        (0.45, LampLevel.GOOD, "MB"),
        (SLOW_SYNC_S + 0.1, LampLevel.WATCH, "SLOW 0.7 s"),
        (2.0, LampLevel.WATCH, "SLOW 2.0 s"),
        (STALLED_SYNC_S + 5.0, LampLevel.BAD, "STALLED 8 s"),
    ],
)
def test_recording_lamp_says_how_long_the_disk_takes(age: float, level: LampLevel, said: str) -> None:
    status = replace(RUNNING, recordings=(RecordingStatus("file", age, 1000, 10**11),))
    lamp = of(session_lamps(status, 0.0, NONE, LIMITS), "Recording")
    assert lamp.level is level
    assert said in lamp.words
    assert f"reach the disk within {age:.1f} s; a power cut loses at most that much" in lamp.tip
    console = Console(width=200, record=True, file=io.StringIO())
    console.print(status_tables(status))
    assert f"reaches the disk within {age:.1f} s" in console.export_text()


def test_alarm_when_a_trial_runs_without_a_recording() -> None:
    stalled = (RecordingStatus("file", 4.0, 1000, 10**11),)
    for phase in ("levelling", "running", "holding", "succeeded", "failed"):
        for recordings in ((), stalled):
            status = replace(RUNNING, phase=phase, recordings=recordings)
            assert "NOT RECORDING" in alarm(status, 0.0, NONE, False)
            assert of(session_lamps(status, 0.0, NONE, LIMITS), "Recording").level is LampLevel.BAD
    assert of(session_lamps(replace(RUNNING, recordings=()), 0.0, NONE, LIMITS), "Recording").words == "NO LOGGER"
    assert alarm(RUNNING, 0.0, NONE, False) == ""
    assert alarm(replace(IDLE, recordings=()), 0.0, NONE, False) == ""
    two = replace(RUNNING, recordings=(*RUNNING.recordings, *stalled))
    assert alarm(two, 0.0, NONE, False) == ""
    assert of(session_lamps(two, 0.0, NONE, LIMITS), "Recording").level is LampLevel.WATCH


def test_alarms_for_lost_server_full_disk_and_emergency_stop() -> None:
    assert "NO REPLY" in alarm(RUNNING, 0.9, NONE, False)
    assert "FULL IN 4" in alarm(RUNNING, 0.0, RecentCounts(minutes=4.2), False)
    assert "EMERGENCY STOP" in alarm(STATES["stopped"], 0.0, NONE, False)
    assert "LET GO" in alarm(None, math.inf, NONE, True)
    assert alarm(None, math.inf, NONE, False) == ""


@pytest.mark.parametrize(("status", "goodbye"), [(STATES["finished"], False), (STATES["stopped"], True), (IDLE, True)])
def test_ended_session_raises_no_alarm_and_names_no_key(status: Status, goodbye: bool) -> None:
    assert ended(status, 0.0, False) is status
    over = ended(status, 5.0, goodbye)
    assert alarm(over, 5.0, NONE, False) == ""
    assert words.headline(over, 5.0).words == "SESSION OVER"
    assert "press" not in words.advice(over, "").words
    assert of(session_lamps(over, 5.0, NONE, LIMITS), "Server").words == "ended"
    assert possible(over) == set()


def test_server_silent_for_almost_a_second_is_link_lost() -> None:
    assert of(session_lamps(RUNNING, 0.99, NONE, LIMITS), "Server").level is LampLevel.BAD
    assert of(session_lamps(RUNNING, 0.2, NONE, LIMITS), "Server").level is LampLevel.GOOD
    assert words.headline(RUNNING, 0.99).words == "LINK LOST"
    assert {lamp.level for lamp in session_lamps(RUNNING, 0.99, NONE, LIMITS)[1:]} == {LampLevel.OFF}
    assert of(session_lamps(None, math.inf, NONE, LIMITS), "Server").words == "not found"


def test_deadline_miss_lamp_uses_recent_misses() -> None:
    for recently, level in ((0, LampLevel.GOOD), (3, LampLevel.WATCH), (21, LampLevel.BAD)):
        assert (
            of(session_lamps(RUNNING, 0.0, RecentCounts(late_ticks=recently), LIMITS), "Deadline misses").level is level
        )


def test_missing_consent_is_bad_except_in_a_pilot() -> None:
    unasked = replace(RUNNING, consent=False)
    assert of(session_lamps(unasked, 0.0, NONE, LIMITS), "Session").level is LampLevel.BAD
    assert of(session_lamps(STATES["pilot"], 0.0, NONE, LIMITS), "Session").words == "pilot"


def test_banner_distinguishes_pilot_real_and_unopened_sessions() -> None:
    pilot, real = words.banner(STATES["pilot"]), words.banner(RUNNING)
    assert pilot.words.startswith("PILOT")
    assert "REAL" not in pilot.words
    assert real.words.startswith("REAL")
    assert "PILOT" not in real.words
    assert pilot.tone is not real.tone
    assert words.banner(STATES["unopened"]).words.startswith("not opened")


@pytest.mark.parametrize(
    ("state", "headline"),
    [
        ("unopened", "NOT OPENED"),
        ("ready", "READY"),
        ("waiting", "WAITING"),
        ("running", "RUNNING"),
        ("holding", "HOLDING"),
        ("paused", "PAUSED"),
        ("stopped", "STOPPED"),
        ("rest", "REST 1:23"),
        ("finished", "SESSION FINISHED"),
    ],
)
def test_headline_names_the_state(state: str, headline: str) -> None:
    assert words.headline(STATES[state], 0.0).words == headline


def test_advice_names_the_next_key_or_the_missing_peer() -> None:
    assert "press F3" in words.advice(STATES["unopened"], "").words
    assert "press Enter" in words.advice(STATES["unopened"], "", form=True).words
    assert "press F3" not in words.advice(STATES["unopened"], "", form=True).words
    assert "F1" in words.advice(IDLE, "").words
    assert "agent.right and the logger" in words.advice(STATES["waiting"], "").words
    assert words.advice(STATES["paused"], "").words.endswith("lost; to resume, press F7")
    assert "pause after this trial" in words.advice(STATES["holding"], "").words
    assert "Ctrl+R" in words.advice(STATES["stopped"], "").words
    assert "Ctrl+E" in words.advice(STATES["finished"], "").words
    assert words.advice(replace(STATES["finished"], blocks=STATES["finished"].block + 1), "").words == ""
    assert "lab0:5550" in words.advice(None, "lab0:5550").words


def test_advice_before_the_devices_are_armed_is_to_arm_them() -> None:
    unarmed = tuple(f"the {side} {AWAITING_ARMING}" for side in SIDES)
    idle = replace(IDLE, armed=False, waiting_for=unarmed, notice=f"waiting for {in_words(unarmed)}")
    said = "Waiting for both devices to be armed; to start the block, press F1 to arm the devices, then F2"
    assert words.advice(idle, "").words == said
    assert words.advice(replace(idle, phase="paused"), "").words.endswith(
        "to resume, press F1 to arm the devices, then F7"
    )
    assert "F2" not in words.advice(replace(idle, armed=True), "").words
    assert "F2" not in words.advice(replace(idle, waiting_for=(*unarmed, "the logger")), "").words


def test_advice_hides_neither_a_questionnaire_nor_the_reason_of_a_pause() -> None:
    asked = replace(IDLE, notice="ask now: workload; waiting for the left agent", waiting_for=("the left agent",))
    assert words.advice(asked, "").words == "Ask now: workload; waiting for the left agent"
    paused = replace(STATES["paused"], waiting_for=("the logger",), pending="end after this block")
    said = words.advice(paused, "").words
    assert said == "Paused: the right device is lost; waiting for the logger; planned: end after this block"
    running = replace(RUNNING, notice="the disk is slow", pending="end after this block")
    assert words.advice(running, "").words == "The disk is slow; planned: end after this block"


def test_attempt_row_shows_outcome_consequence_and_repeated_trial() -> None:
    cells = [words.attempt_cells(attempt, USUAL_RULE) for attempt in attempts(10)]
    assert cells[2][3:] == ("ball fell", "", "counts")
    assert cells[7][3:] == ("success", "3.16 s", "excluded: deadline misses, lost samples")
    assert cells[8][3:] == ("aborted", "", "excluded")
    assert cells[9][5] == "counts, repeats trial 5"
    assert words.attempt_tone(attempts(10)[7], USUAL_RULE) is Tone.BAD
    long = attempts(1)[0]._replace(flags="too_long", outcome="success")
    assert words.attempt_cells(long, USUAL_RULE)[5] == "counts, flagged: too long"
    assert words.attempt_tone(long, USUAL_RULE) is Tone.WATCH
    stopped = attempts(1)[0]._replace(outcome="emergency_stop")
    assert words.attempt_cells(stopped, USUAL_RULE)[3] == "emergency stop"


def test_advice_offers_to_repeat_lost_trials_and_how_to_go_on() -> None:
    said = words.advice(STATES["lost"], "").words
    assert said == (
        "7 of 60 trials will be excluded: deadline misses; to repeat these 7, press Ctrl+F9; "
        "to continue without them, press Ctrl+N twice"
    )
    last = replace(STATES["lost"], block=18, lost=(3,))
    assert words.advice(last, "").words.endswith("repeat it, press Ctrl+F9; to end the session, press Ctrl+E twice")
    assert words.advice(replace(STATES["lost"], phase="running"), "").words.endswith("press Ctrl+F9")


def test_badge_agrees_with_the_most_severe_lamp() -> None:
    for name, said, tone in (
        ("running", "RUNNING", Tone.GOOD),
        ("troubled", "RUNNING: FAULT", Tone.BAD),
        ("paused", "PAUSED", Tone.WATCH),
        ("stopped", "STOPPED", Tone.BAD),
        ("unopened", "NOT OPENED", Tone.WATCH),
    ):
        lamps = session_lamps(STATES[name], 0.0, NONE, LIMITS) + station_lamps(STATES[name], NONE, "right", LIMITS)
        assert words.badge(STATES[name], 0.0, lamps) == words.TonedText(said, tone), name
    slow = replace(IDLE, links=(IDLE.links[0], UNARMED_LINK))
    assert words.badge(slow, 0.0, station_lamps(slow, NONE, "right", LIMITS)).words.startswith("READY: ")


@pytest.mark.parametrize("state", STATES)
def test_badge_never_looks_better_than_a_lamp(state: str) -> None:
    lamps = session_lamps(STATES[state], 0.0, NONE, LIMITS) + station_lamps(STATES[state], NONE, "right", LIMITS)
    worst = max(lamp.level for lamp in lamps)
    severity = {Tone.BAD: LampLevel.BAD, Tone.WATCH: LampLevel.WATCH}
    assert severity.get(words.badge(STATES[state], 0.0, lamps).tone, LampLevel.GOOD) >= worst


@pytest.mark.parametrize("phase", ["idle", "paused", "finished"])
def test_forces_lamp_is_not_green_between_trials(phase: str) -> None:
    lamps = {lamp.name: lamp for lamp in session_lamps(replace(RUNNING, phase=phase), 0.0, NONE, LIMITS)}
    assert (lamps["Forces"].level, lamps["Forces"].words) == (LampLevel.OFF, "none now")


def test_blocks_ahead_are_those_of_the_plan() -> None:
    planned = replace(RUNNING, ahead=("dyadic, haptics off", "bimanual B"))
    assert words.ahead(planned) == "Next: dyadic, haptics off, then bimanual B"
    assert words.ahead(replace(RUNNING, block=RUNNING.blocks)) == "This is the last block"
    assert words.ahead(STATES["unopened"]) == ""


# --- commands -----------------------------------------------------------------------------------------------------


def test_last_block_has_no_next_one() -> None:
    by_name = {command.name: command for command in COMMANDS}
    last = replace(RUNNING, block=RUNNING.blocks)
    assert refusal(by_name["next"], last, last.commander) == "this is the last block: end the session (Ctrl+E)"
    assert refusal(by_name["next"], replace(last, phase="paused", block=1, blocks=2), last.commander) == ""


def test_keys_are_unique_and_the_commands_are_those_of_the_protocol() -> None:
    rows = [*COMMANDS, RELEASING, CONFIRMING]
    keys = [command.key for command in rows] + [*STOP_KEYS]
    assert len(set(keys)) == len(keys)
    buttons = {command.name for command in rows} | {STOP}
    assert buttons == set(control.SESSION_COMMANDS) - {"stop"}, "COMMANDS in windows/operator/commands.py"


def test_stand_ins_of_a_real_session_are_faults_until_they_are_confirmed() -> None:
    for state, level in (("simulated", LampLevel.BAD), ("confirmed", LampLevel.WATCH)):
        lamps = {lamp.name: lamp for lamp in station_lamps(STATES[state], NONE, "right", LIMITS)}
        assert (lamps["Device"].words, lamps["Device"].level) == ("simulated", level)
        assert (lamps["Display"].words, lamps["Display"].level) == ("off screen", level)
    left = station_lamps(STATES["simulated"], NONE, "left", LIMITS)[0]
    assert (left.level, left.words) == (LampLevel.GOOD, "Touch")
    assert "serial 4711" in left.tip


def test_banner_names_the_stand_ins_of_a_real_session() -> None:
    found = words.banner(STATES["confirmed"])
    assert found.words.startswith("REAL, with right device simulated, right display off screen")
    assert found.tone is Tone.BAD
    assert words.banner(STATES["no_consent"]).words.startswith("NO CONSENT")


def test_line_of_a_station_names_participant_device_and_hidden_display() -> None:
    session, block = Session(participant_a="P07", participant_b="P08", seat_a="right"), Block()
    assert [words.seated(session, block, side) for side in ("left", "right")] == ["B: P08", "A: P07"]
    alone = Block(configuration="bimanual", performer="B")
    assert [words.seated(session, alone, side) for side in ("left", "right")] == ["B: P08", "B: P08"]
    assert words.seated(session, Block(left="robot"), "left") == ""
    line = words.rig(STATES["simulated"], "right", "A: P07")
    assert line.words.startswith("RIGHT  A: P07\nsimulated, no device: virtual Touch, serial virtual-right")
    assert line.words.endswith("display off screen")
    assert line.tone is Tone.WATCH
    assert words.rig(STATES["simulated"], "left", "").tone is Tone.PLAIN


def test_unconfirmed_stand_ins_are_what_to_do_next() -> None:
    advice = words.advice(STATES["simulated"], "")
    assert "right device simulated" in advice.words
    assert "Shift+F3" in advice.words
    assert not refusal(CONFIRMING, STATES["simulated"], "me")
    assert refusal(CONFIRMING, STATES["confirmed"], "me")


def possible(status: Status | None, own: str = "me") -> set[str]:
    return {command.name for command in (*COMMANDS, RELEASING) if not refusal(command, status, own)}


def test_possible_commands_depend_on_the_state() -> None:
    assert possible(None) == set()
    assert possible(STATES["unopened"]) == {"open", "note", "arm", "take", "end"}
    assert {"arm", "next", "end"} <= possible(IDLE)
    assert "start" in possible(replace(IDLE, armed=True))
    assert "resume" not in possible(RUNNING)
    running = {"pause", "pause_after_trial", "abort", "skip", "stop_after_block", "disarm", "note"}
    assert running <= possible(RUNNING)
    for phase in ("idle", "paused", "finished"):
        assert "stop_after_block" in possible(replace(RUNNING, phase=phase))
    assert {"resume", "skip"} <= possible(replace(RUNNING, phase="paused"))
    assert "emergency_release" in possible(STATES["stopped"])
    assert "resume" not in possible(STATES["stopped"])
    assert "arm" not in possible(replace(IDLE, waiting_for=(AWAITING_RELEASE,)))


def test_repeats_are_possible_only_if_there_is_a_trial_for_them() -> None:
    repeats = {"repeat", "repeat_lost", "veto"}
    assert possible(IDLE) & repeats == set()
    assert possible(replace(RUNNING, trial=1, phase="levelling")) & repeats == set()
    assert possible(replace(RUNNING, trial=1)) & repeats == {"repeat"}
    assert possible(replace(RUNNING, trial=3, phase="paused")) & repeats == {"repeat"}
    assert possible(replace(RUNNING, trial=3, phase="paused", repeats=(1, 2))) & repeats == {"veto"}
    assert possible(STATES["lost"]) & repeats == repeats


def test_questionnaire_can_be_skipped_only_while_it_waits_for_answers() -> None:
    over = replace(RUNNING, phase="finished")
    assert "skip_form" not in possible(over)
    waiting = replace(over, notice=f"{FORM_AWAITED}left, 57 s at most")
    assert "skip_form" in possible(waiting)
    assert words.advice(waiting, "").words.endswith("to go on without the answers, press Ctrl+F10 twice")


@pytest.mark.parametrize("missing", ["", "the logger", AWAITING_RELEASE, f"the left {AWAITING_ARMING}"])
@pytest.mark.parametrize("phase", ["idle", "levelling", "running", "holding", "paused", "finished"])
def test_possible_commands_are_those_that_the_server_accepts(phase: str, missing: str) -> None:
    for armed, (blocks, study) in product((False, True), ((1, ""), (1, "paper"), (2, "paper"))):
        waiting = (missing,) if missing else ()
        status = replace(RUNNING, phase=phase, armed=armed, block=1, blocks=blocks, study=study, waiting_for=waiting)
        situation = Situation(Phase[phase.upper()], waiting, last=blocks == 1, plan=bool(study))
        for name in possible(replace(status, outcomes=1)) - {"open"}:
            operators = Operators(opened=True, armed=armed)
            assert operators.decide(CommandRequest(b"me", "me", control.Command(name, "", 1)), situation).accepted, (
                name,
                status,
            )


def test_observer_may_take_over_and_add_notes() -> None:
    assert possible(STATES["watched"], "me") == {"take", "note"}
    reason = refusal(COMMANDS[0], STATES["watched"], "me")
    assert "lab2:4711" in reason
    assert "T" in reason
    assert "take" not in possible(STATES["watched"], "lab2:4711")


def test_replay_has_its_own_banner_and_raises_only_the_no_reply_alarm() -> None:
    replay = replace(RUNNING, notice=f"{REPLAY_OF}S01.mcap: playing at 0:03.0", recordings=(), consent=False)
    assert words.banner(replay).words.startswith("REPLAY")
    assert words.banner(replay).tone not in (Tone.PLAIN, Tone.WATCH), "a replay looks like a real session or a pilot"
    assert words.advice(replay, "lab0:5550").words == replay.notice
    assert "may control a replay" in words.commander(replay, "me").words
    assert {lamp.level for lamp in session_lamps(replay, 0.0, NONE, LIMITS)[1:]} == {LampLevel.OFF}
    assert alarm(replay, 0.0, NONE, unconfirmed=True) == ""
    assert "NO REPLY FROM THE SERVER" in alarm(replay, 60.0, NONE, unconfirmed=False)
    assert possible(replay) == possible(replace(replay, phase="idle")) == {"pause", "resume", "next", "end"}


def test_logger_without_a_file_yet_is_ready_and_its_disk_lamp_is_off():
    waiting = replace(IDLE, opened=False, recordings=(RecordingStatus("", math.nan, 0, 0),))
    lamps = session_lamps(waiting, 0.0, NONE, LIMITS)
    assert (of(lamps, "Recording").level, of(lamps, "Recording").words) == (LampLevel.GOOD, "ready")
    assert of(lamps, "Disk").level is LampLevel.OFF
