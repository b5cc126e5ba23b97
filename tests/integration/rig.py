"""A real rig on loopback for tests: processes, a free port, an operator."""

from netboard.faults.rigs import PATIENCE, Rig

__all__ = ["PATIENCE", "Rig"]
