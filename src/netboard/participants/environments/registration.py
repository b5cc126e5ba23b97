"""Registration of the environments in Gymnasium, by import paths: nothing else is imported before one is made."""

import gymnasium

BOARD = "netboard/Board-v1"
"""Id of the environment of one agent."""

_ROOM = "netboard.participants.environments"


def register() -> None:
    """Register the environments in Gymnasium, once."""
    if BOARD not in gymnasium.registry:
        gymnasium.register(
            BOARD, entry_point=f"{_ROOM}.single:BoardEnv", vector_entry_point=f"{_ROOM}.vector:BoardVectorEnv"
        )


register()
