"""The tables of the configuration, one frozen dataclass each, and what contradicts what in them (pure)."""
