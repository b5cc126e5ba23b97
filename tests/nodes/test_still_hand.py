"""A hand that is held still: live, at rest, without a force, whatever device is connected at its side."""

import numpy as np
import pytest

from netboard.base.config import SIDES, Side
from netboard.base.safeguards import Safeguard
from netboard.base.tick import TICK
from netboard.nodes.server.still_hand import fill_still

T0 = 5_000_000_000


@pytest.mark.parametrize("side", SIDES)
def test_still_hand_is_live_and_at_rest(side: Side) -> None:
    rows = np.zeros(1, TICK)
    other = "right" if side == "left" else "left"
    for one in SIDES:
        rows[f"{one}_sent_z"], rows[f"{one}_sent_vz"], rows[f"{one}_x"] = 0.03, 0.2, 0.001
        rows[f"{one}_rendered"] = np.nan
    fill_still(rows.view(np.int64), side, 7, T0)
    row = rows[0]
    assert (row["tick"], row["time_ns"], row[f"{side}_live"], row[f"{side}_seq"]) == (7, T0, 1, 7)
    assert row[f"{side}_safeguards"] == Safeguard.ARMED
    assert T0 - row[f"{side}_stamp_ns"] == row[f"{side}_lead_ns"] > 0
    for name in ("sent_z", "sent_vz", "x", "y", "rendered"):
        assert row[f"{side}_{name}"] == 0.0
    assert (row[f"{other}_sent_z"], row[f"{other}_live"]) == (0.03, 0)
