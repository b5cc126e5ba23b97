"""The states of a participant's display: those of docs/display_states.py, and a questionnaire."""

from dataclasses import replace
from typing import Any

from netboard.base.config import Config
from netboard.base.tables.experiment import Block
from netboard.base.tables.questionnaires import FormQuestion
from netboard.stage.view import View
from netboard.windows.participant.form import FormWidget
from netboard.windows.participant.language import load_words
from netboard.windows.participant.screens import blank, compose
from netboard.windows.participant.window import BoardWindow

WORDS, CONFIG = load_words("en"), replace(Config(), block=Block(number=3, blocks=18))
VIEW = View(
    station="left",
    tick=0,
    sent_ns=0,
    phase="running",
    z=0.0,
    theta=0.0,
    p=-0.15,
    target=0.15,
    left=0.0,
    right=None,
    trial=12,
    trials=60,
    failures=1,
    completion=3.42,
    best=2.90,
    notice="",
    seq=0,
    share=0.0,
    block=3,
    blocks=18,
    rest=None,
)
PHASES: dict[str, dict[str, Any]] = {
    "ready": {"phase": "idle"},
    "rest": {"phase": "idle", "rest": 74.3},
    "trial": {"theta": -0.03, "p": -0.04, "left": 0.007},
    "holding": {"phase": "holding", "p": 0.142, "theta": 0.004, "share": 0.55},
    "pause": {"phase": "paused", "p": 0.03, "theta": -0.01, "notice": "pause_operator"},
    "finished": {"phase": "finished", "block": 18},
}
QUESTIONS = {
    "questionnaire": FormQuestion(
        kind="likert",
        text="I knew what my partner was going to do.",
        steps=7,
        low="strongly disagree",
        high="strongly agree",
    ),
    "questionnaire-scale": FormQuestion(
        kind="vas", text="How hard did you have to work?", low="very low", high="very high"
    ),
}
NAMES = ("waiting", *PHASES, *QUESTIONS)


def make() -> BoardWindow:
    """Return a participant's window."""
    return BoardWindow("display")


def show(window: BoardWindow, state: str) -> None:
    """Show a state."""
    for form in window.findChildren(FormWidget):
        form.setParent(None)
        form.deleteLater()
    if state in QUESTIONS:
        window.cover(FormWidget(window, {state: QUESTIONS[state]}, WORDS))
    elif state == "waiting":
        picture = blank(CONFIG, WORDS, WORDS.waiting, WORDS.server.format(host="10.0.0.1", port=5550))
        window.board.show_picture(picture)
    else:
        window.board.show_picture(compose(replace(VIEW, **PHASES[state]), CONFIG, WORDS))


def leave(window: BoardWindow) -> None:
    """Close a window."""
    window.close()
