"""Every number that acts in a simulated participant is a key of the configuration; the rest is listed here."""

import ast
from collections.abc import Iterator
from pathlib import Path

import netboard.participants

KNOWN = {
    "block": {
        "PIECE": "capacity",
        "START_TICK": "waiting time of the live server",
        "MAX_MEAN_TRIAL": "time after which a block is stopped",
        "UNWATCHED": "kernel that does nothing",
    },
    "body": {
        "BEFORE": "steps of the integration",
        "LEAD_NS": "step of the integration",
        "STEPS": "steps of the integration",
        "BODY": "type",
        "READINGS": "type",
    },
    "controller": {"FORESIGHT_STEPS": "steps of an integration", "CONSTANTS": "type", "MOVE": "type", "STATE": "type"},
    "cable": {"CABLES": "type", "TIP": "type"},
    "device_models": {"MODELS": "devices, each with its source"},
    "dyad_model": {
        "X": "places in a state",
        "STATES": "length of a state",
        "SEEN": "names",
        "Matrix": "type",
        "FLOOR": "regularises the equations of the filter",
    },
    "expectations": {"INTENTS": "capacity", "BOTH": "a code", "INTENT": "type"},
    "muscles": {"CAPACITY": "capacity", "FORCE_HISTORY": "capacity", "ARM": "type", "MUSCLES": "type"},
    "observer": {
        "MEASURED": "number of quantities",
        "STRETCH": "capacity",
        "DOUBLINGS": "time until the filter is stationary",
        "OBSERVER": "type",
        "OBSERVED": "type",
    },
    "partner_models": {"PARTNER_MODELS": "models, each with its source", "INFORMED": "names"},
    "partners": {"GROUP": "a name", "POLICIES": "names"},
    "person": {"DECISION_TICKS": "step of the controller", "PERSON": "type"},
    "policy": {
        "SEEN": "type",
        "TRUTH": "type",
        "OBSERVATION": "type",
        "Decide": "type",
        "SIMULATED_PARTICIPANT": "a name",
    },
    "population": {
        "SPREAD": "how participants differ, on the page of the participants",
        "VARIED": "how participants differ, on the page of the participants",
        "LETTERS": "names",
    },
    "leader": {
        "PEAK": "of the minimum-jerk polynomial",
        "LEADER_SOURCES": "sources of the parameters",
        "PATH": "type",
        "LEADING": "type",
    },
    "board_model": {
        "Matrix": "type",
        "NAMES": "names",
        "X": "places in a state",
        "WATCHED": "length of a state",
        "SEEN": "places in a state",
        "FLOOR": "regularises the equations of the filter",
        "FIXED_RATE": "regularises the equations of the filter",
        "BOARD_SOURCES": "sources of the parameters",
    },
    "game": {"PUSH": "unit of an estimate"},
    "learned": {
        "PERIOD": "trained with it, on the page of the robots",
        "SPEED": "trained with it, on the page of the robots",
        "STALL_SPEED": "trained with it",
        "MOST_STALL": "trained with it",
        "INPUT_BOUND": "limit of an input",
        "INPUTS": "scales of the inputs",
        "PACKAGED": "a name",
    },
    "lqg": {
        "MEMORY": "capacity",
        "LONGEST_SIGHT": "limit of a search",
        "PARTNERS": "partners of the check of stability, on the page of the robots",
        "FILTER": "type",
        "FILTERED": "type",
        "REGULATOR": "type",
    },
    "network": {
        "FORMAT": "a name",
        "VERSION": "version of a file",
        "LAYERS": "length of a network",
        "MOST_UNITS": "limit of a file",
        "MOST_WEIGHT": "limit of a file",
    },
    "network_stability": {"LONGEST": "limit of a search", "Array": "type"},
    "playback": {
        "STEP_TICKS": "ticks between two heights that are kept",
        "MOST_TRIALS": "capacity",
        "MOST_HEIGHTS": "capacity",
        "PLAYBACK_SOURCES": "sources of the parameters",
    },
    "robot": {
        "HAND_SOURCES": "sources of the parameters",
        "MARGIN": "margin of stability, on the page of the robots",
        "SOURCES": "sources of the parameters",
        "HAND": "type",
    },
    "sight": {
        "PLAUSIBLE": "limit of a view",
        "SMOOTHING": "views, on the page of the robots",
        "BOARD": "type",
        "SIGHT": "type",
    },
    "steering": {
        "STEERING_SOURCES": "sources of the parameters",
        "STEERING": "type",
        "LONGEST_STEERING": "limit of a search",
    },
    "senses": {
        "DECISION_INTERVAL": "step of the controller",
        "MEMORY": "capacity: longer than every delay",
        "ROOM": "capacity",
        "FELT": "type",
        "NOISES": "names",
        "SENSES": "type",
        "PERCEPT": "type",
    },
    "registration": {"BOARD": "a name"},
    "scenes": {"Array": "type"},
    "agents": {"METHOD": "a name"},
    "arrays": {"LANES": "length of a register", "BOTH": "length of a register"},
    "reduced_steps": {
        "LONGEST": "step of the integration, on the page of the environments",
        "ROWS": "length of a state",
        "VIEW_ROWS": "length of a view",
    },
    "spaces": {
        "ACTIONS": "scales of an agent's numbers",
        "VIEW": "scales of an agent's numbers",
        "HAND": "scales of an agent's numbers",
        "TRUTH": "scales of an agent's numbers",
        "BOUND": "bound of an agent's numbers",
        "SPEED_ACTION": "scale of an agent's numbers",
    },
    "stylus": {
        "STEP_NS": "step of the integration",
        "STEP": "step of the integration",
        "UPDATE_STEPS": "steps of the integration",
        "LANES": "length of a register",
        "ACTION": "type",
        "MAX_HAND_FORCE": "limit of what is no error, far above the forces of the participants",
        "MECHANICS": "type",
        "STYLUS": "type",
    },
    "vector": {"MAX_SEED": "range of seeds"},
    "velocity_window": {"SAMPLES": "capacity", "AXES": "length of a register", "SLACK": "allows for rounding"},
}
"""Constants of the modules that are no parameter of a participant, and what they are."""


def constants_of(path: Path) -> Iterator[str]:
    """Yield the names that a module assigns at its top level, without those that begin with an underscore."""
    for node in ast.parse(path.read_text()).body:
        targets = (
            node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
        )
        yield from (one.id for one in targets if isinstance(one, ast.Name) and not one.id.startswith("_"))


def test_every_constant_of_the_participants_is_known() -> None:
    (folder,) = map(Path, netboard.participants.__path__)
    found = {path.stem: set(constants_of(path)) for path in folder.rglob("*.py")}
    assert {module: names for module, names in found.items() if names} == {
        module: set(names) for module, names in KNOWN.items()
    }
