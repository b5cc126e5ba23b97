"""Parameters say what they take: few of netboard's are annotated with `Any`."""

import ast
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent

MOST_OF_ANY = 90
"""Parameters that may be `Any`, such as objects of libraries without types and numbers that are lanes as well [1]."""


def parameters(text: str) -> Iterator[ast.arg]:
    """Parameters of all functions of a module, except self and cls."""
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            these = node.args
            for one in (*these.posonlyargs, *these.args, *these.kwonlyargs, these.vararg, these.kwarg):
                if one is not None and one.arg not in ("self", "cls"):
                    yield one


def test_few_parameters_are_any() -> None:
    paths = [*(ROOT / "src").rglob("*.py"), *(ROOT / "services").rglob("*.py")]
    written = [
        ast.unparse(one.annotation)
        for path in paths
        for one in parameters(path.read_text(encoding="utf-8"))
        if one.annotation
    ]
    assert len(written) > 7000, "the parameters are found"
    assert written.count("Any") <= MOST_OF_ANY


def test_every_kind_of_parameter_is_found() -> None:
    text = "def f(a: int, /, b: int, *c: int, d: int, **e: int):\n    async def g(self, x): ..."
    assert [one.arg for one in parameters(text)] == ["a", "b", "d", "c", "e", "x"]
