"""The tables of the configuration, one frozen dataclass each."""
