"""The tables of the configuration, one frozen dataclass each, and the checks across tables."""
