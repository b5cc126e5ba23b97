"""Makes the scenes and the independent equations of motion in tests/physics importable."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parents[1] / "physics"))
