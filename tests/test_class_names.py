"""One name has one meaning: no two public classes of netboard have the same name."""

import re
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).parent.parent

EXCEPTIONS: dict[str, str] = {}
"""Names that two classes may have, each with the reason."""


def test_public_classes_have_names_of_their_own() -> None:
    places: dict[str, list[str]] = defaultdict(list)
    for path in [*(ROOT / "src").rglob("*.py"), *(ROOT / "services").rglob("*.py")]:
        for name in re.findall(r"^class ([^\W_]\w*)", path.read_text(encoding="utf-8"), re.MULTILINE):
            places[name].append(str(path.relative_to(ROOT)))
    assert len(places) > 300, "the classes are found"
    twice = {name: found for name, found in places.items() if len(found) > 1}
    assert {name: found for name, found in twice.items() if name not in EXCEPTIONS} == {}
    assert set(EXCEPTIONS) <= set(twice), "no exception is left over"
