"""The kernels that a session needs: what is run to compile them, and what is said of a process that ended."""

from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool

import pytest

from netboard.base import kernel_cache
from netboard.base.config import parse
from netboard.base.errors import NetboardError
from netboard.nodes.launching.kernels import _are_built_in, _are_over, _name_of, _served, _unopened


def test_worker_that_was_killed_is_an_error_in_words() -> None:
    task: Future[None] = Future()
    task.set_exception(BrokenProcessPool("terminated abruptly"))
    with pytest.raises(NetboardError, match="a process that compiles ended, perhaps because memory ran out"):
        _are_over([task])


def test_agent_runs_with_its_own_device_and_once_as_each_robot_partner_of_the_blocks() -> None:
    rig = parse("", overrides=["agents.right.device=falcon", "agents.right.velocity=kalman"])
    given = [
        ["block.right=person"],
        ["block.right=follower", "partners.right.initiative=0.2"],
        ["block.right=follower", "partners.right.initiative=0.4"],
        ["block.right=follower", "partners.right.initiative=0.2", "block.number=2", "block.blocks=2"],
        ["block.left=leader"],
    ]
    blocks = [parse("", overrides=["agents.right.velocity=kalman", *overrides]) for overrides in given]
    served = [(one.agents.right, one.partners.right) for one in _served(rig, blocks, "right")]
    assert [(agent.device, agent.velocity, dict(agent.options), dict(parameters)) for agent, parameters in served] == [
        ("virtual", "device", {}, {}),
        ("partner", "kalman", {"partner": "follower"}, {"initiative": 0.2}),
        ("partner", "kalman", {"partner": "follower"}, {"initiative": 0.4}),
    ]


@pytest.mark.parametrize(
    ("overrides", "built_in"),
    [
        ([], True),
        (["block.left=follower", "agents.right.device=falcon"], True),
        (["block.left=ours"], False),
        (["agents.right.device=ours"], False),
        (["agents.right.device=partner", "agents.right.options.partner=ours"], False),
    ],
)
def test_code_of_a_lab_is_looked_at_again_at_each_start(overrides: list[str], built_in: bool) -> None:
    config = parse("", overrides=overrides)
    assert _are_built_in(config, [config]) is built_in


def test_session_is_looked_at_again_with_another_compiler_or_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cache on a share serves several machines, and stays when numba is updated."""
    config = parse("")
    names = [_name_of(config, [config], [])]
    for place in range(len(kernel_cache.compiler())):
        other = [*kernel_cache.compiler()]
        other[place] = "another"
        with monkeypatch.context() as patch:
            patch.setattr(kernel_cache, "compiler", lambda: tuple(other))  # noqa: B023
            names.append(_name_of(config, [config], []))
    assert len(set(names)) == len(names) == 1 + 5
    assert _name_of(config, [config], []) == names[0]


def test_device_that_cannot_be_made_here_does_not_stop_the_preparation() -> None:
    given = ["agents.left.device=openhaptics", "agents.left.options.library=none"]
    missing = parse("", overrides=[*given, "agents.left.stop_buttons=256"])
    assert _unopened(missing, "left") is None
    assert _unopened(missing, "right") is None, "a simulated device is opened"
