"""Sessions of robots in real processes: what the table says of a recording, and when the claim fails."""

from pathlib import Path

import pytest

from evidence.participants.live import live_part, netboard, read
from netboard.base.errors import NetboardError

LIVE = Path(__file__).parents[2] / "data" / "sessions" / "live-session.mcap"


def test_table_has_what_the_recording_says() -> None:
    session = read(LIVE)
    part = live_part({"leader": session})
    row = dict(zip(part.columns, part.rows[0], strict=True))
    assert row["trials [1]"] == len(session.summary.completions) > 0
    assert row["identical to the bit"] == "yes"
    assert 0.0 <= row["samples used again [%]"] < 100.0
    assert part.holds


def test_claim_fails_if_a_tick_is_not_reproduced() -> None:
    session = read(LIVE)
    assert not live_part({"leader": session, "lqg": session._replace(identical=False)}).holds


def test_command_that_fails_says_why() -> None:
    with pytest.raises(NetboardError, match="nobody"):
        netboard("rehearse", "--set", "block.right=nobody")
