"""The commands of ``netboard participants``."""
