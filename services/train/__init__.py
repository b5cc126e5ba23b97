"""The commands of ``netboard train``."""
