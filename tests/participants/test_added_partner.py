"""The partner that docs/how-to/add-a-partner.md shows: it plays both sides, and its parameters are checked."""

import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from netboard.base.config import Config, Side
from netboard.base.errors import ConfigError
from netboard.participants.seat.block import Rehearsal
from netboard.participants.seat.partners import make_partner, names

PAGE = Path(__file__).parents[2] / "docs" / "how-to" / "add-a-partner.md"


@pytest.fixture(autouse=True)
def _package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Install the page's package as a distribution."""
    text = PAGE.read_text()
    (program,) = re.findall(r"```python\n(.*?)```", text, re.DOTALL)
    ((group, entry),) = re.findall(r'\[project\.entry-points\."(\S+)"\]\n\s*(\w+ = "\S+")', text)
    package, info = tmp_path / "mypackage", tmp_path / "mypackage-1.0.dist-info"
    for folder in (package, info):
        folder.mkdir()
    (package / "__init__.py").write_text("")
    (package / "steady.py").write_text(program)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: mypackage\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[{group}]\n{entry.replace(chr(34), '')}\n")
    monkeypatch.syspath_prepend(tmp_path)
    for name in ("mypackage", "mypackage.steady"):
        monkeypatch.delitem(sys.modules, name, raising=False)


def test_partner_of_another_package_is_registered_with_checked_parameters() -> None:
    assert "steady" in names()
    config = Config()
    identity = make_partner("steady", config, "right").identity
    assert (identity["policy"], identity["policy_parameters"]) == ("steady", '{"kd": 2.0, "kp": 1.5}')
    wrong = replace(config, partners=replace(config.partners, right={"kp": -1.0}))
    with pytest.raises(ConfigError, match=r"\[partners.right\] kp: found -1"):
        make_partner("steady", wrong, "right")


@pytest.mark.slow
@pytest.mark.parametrize("side", ["left", "right"])
@pytest.mark.parametrize("other", ["person", "still"])
def test_partner_of_the_page_completes_trials(side: Side, other: str) -> None:
    config = Config()
    movers = {"left": "steady", "right": other} if side == "left" else {"left": other, "right": "steady"}
    config = replace(config, block=replace(config.block, trials=2, **movers))
    rehearsal = Rehearsal(config, {"A": config.participant, "B": config.participant})
    heights = np.concatenate([rows[f"{side}_sent_z"].copy() for rows in rehearsal.pieces()])
    assert len(rehearsal.summary().completions) == 2
    assert np.ptp(heights) > 0.005
