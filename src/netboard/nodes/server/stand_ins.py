"""What stands in for a haptic device or a screen in a session, and the operator's confirmations of it in words.

A session with the consent of both participants that is no pilot is real: its data count. A simulated device, a mouse or
a display that nobody sees would pass for the real thing there. So a real session waits until an operator has named each
of them in words; the words are recorded in every block. Pure: it gets all as arguments.
"""

import re
from collections.abc import Iterable, Mapping, Sequence

from netboard.base.config import SIDES, Config, Side
from netboard.base.device_kind import STAND_INS, device_stand_in, display_stand_in, held_by
from netboard.base.errors import ConfigError
from netboard.base.process.display_server import unseen

AWAITING_WORDS = "a confirmation in words (confirm)"
"""Beginning of what a real session waits for while a stand-in is unconfirmed."""

TRIGGER_STAND_IN = "trigger box simulated"
"""The words that confirm a simulated trigger box."""

KNOWN = (
    *(
        words
        for side in SIDES
        for words in (*(device_stand_in(side, kind) for kind in STAND_INS.values()), display_stand_in(side))
    ),
    TRIGGER_STAND_IN,
)
"""The words of every possible stand-in."""


def stand_ins(
    config: Config, agents: Mapping[Side, Mapping[str, str]], platforms: Mapping[Side, str]
) -> tuple[str, ...]:
    """Return the words of each stand-in of a block.

    ``agents``: details of the connected agents, of the sides that a person moves. ``platforms``: by which platform of
    Qt the display of each station is drawn.
    """
    haptics = config.block.haptics
    held = {side: held_by(details).stand_in(haptics=haptics) for side, details in agents.items()}
    devices = [device_stand_in(side, words) for side, words in held.items() if words]
    return (*devices, *(display_stand_in(side) for side, platform in platforms.items() if unseen(platform)))


class Confirmations:
    """What operators have confirmed in words, each text with the operator's name.

    ``words``: the confirmation of the command line; empty for none.
    """

    def __init__(self, words: str = "") -> None:
        self._said: list[tuple[str, str]] = []
        self._noted: set[str] = set()
        if words:
            require_known(words)
            self._said.append((words, "the command line of the server"))

    def unconfirmed(self, found: Iterable[str]) -> tuple[str, ...]:
        """Return the stand-ins that nobody has confirmed."""
        return tuple(words for words in found if self._by(words) is None)

    def confirm(self, text: str, by: str, found: Sequence[str]) -> str:
        """Take an operator's text, which names one stand-in or more; return what it confirms, and what it leaves."""
        require_known(text)
        self._said.append((text, by))
        confirmed = ", ".join(words for words in KNOWN if names(text, words))
        left = ", ".join(self.unconfirmed(found))
        return f"confirmed: {confirmed}; not yet: {left}" if left else f"confirmed: {confirmed}"

    def begin_file(self) -> None:
        """Note everything again: another block, or another logger, begins another file."""
        self._noted.clear()

    def take_news(self, found: Iterable[str]) -> list[dict[str, str]]:
        """Return the details of the events to record: confirmed stand-ins that are not noted yet in this file."""
        news = []
        for words in found:
            said = self._by(words)
            if said is not None and words not in self._noted:
                self._noted.add(words)
                news.append({"what": words, "words": said[0], "by": said[1]})
        return news

    def _by(self, words: str) -> tuple[str, str] | None:
        """Return the newest text that confirms a stand-in, and who gave it."""
        return next((said for said in reversed(self._said) if names(said[0], words)), None)


def require_known(text: str) -> None:
    """Refuse a confirmation that names no possible stand-in."""
    if not any(names(text, words) for words in KNOWN):
        raise ConfigError(
            f'confirm: found "{text}", which names nothing that stands in for a device or a screen; expected words '
            f'such as "{KNOWN[1]}"'
        )


def names(text: str, words: str) -> bool:
    """Return whether a text has these words; case and the space between words do not matter."""
    return re.search(rf"\b{re.escape(words)}\b", " ".join(text.casefold().split())) is not None
