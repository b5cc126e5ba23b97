"""Makes ``tests/*.py`` importable, sets Hypothesis without deadlines, and selects the tests that run."""

import gc
import math
import os
from collections.abc import Generator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

import sampling
from netboard.base.terminal import compiling

pytest.register_assert_rewrite("netboard.testing")

# No deadline: the first example of a test may compile a kernel, and the machine may be busy. The profile is loaded
# before any test is imported, because a decorated test keeps the profile that is active at import.
# The same commit draws the same examples, unless another seed is asked for.
settings.register_profile(
    "untimed",
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
    max_examples=100 if sampling.ALL else 50,
    derandomize=sampling.SEED == 0,
)
settings.load_profile("untimed")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    os.environ.pop("TERM", None)  # a test that needs a terminal says which
    compiling.SHOWN_AFTER_S = math.inf  # what a command prints here does not depend on what is in the cache
    if sampling.SEED and config.getoption("hypothesis_seed") is None:
        config.option.hypothesis_seed = str(sampling.SEED)


def pytest_report_header() -> str:
    return sampling.header()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    quiet = [item.nodeid for item in items if item.get_closest_marker("quiet")]
    if lost := [name for name in quiet if not name.startswith("tests/integration/")]:
        raise pytest.UsageError(f"make test looks for quiet tests in tests/integration only, and would not run {lost}")
    words = [word.partition("::")[0] for word in config.args]
    named = {str(path.relative_to(config.rootpath)) for word in words if (path := Path(word).absolute()).is_file()}
    if out := sampling.left_out(items, named):
        config.hook.pytest_deselected(items=sorted(out, key=items.index))
        items[:] = [item for item in items if item not in out]


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Exempt imported modules and collected tests from garbage collection: they stay, and are most of all objects."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.collect()
        gc.freeze()
        gc.enable()
