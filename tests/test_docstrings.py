"""The pure part's public functions, methods and dataclass fields are documented, every quantity with its unit.

Read from the syntax trees, so that it does not matter what a decorator makes of a function. A quantity is what is
annotated with ``float``, ``int`` or ``NDArray``; its description ends with ``[unit]``, ``[1]`` for a pure number. An
array of records is exempt, for its fields have their own, and so is what may be text as well. An argument that means
the same throughout a package may be described once, in the Parameters of the package's docstring, or of the wing's.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SOURCE = Path(__file__).parent.parent / "src" / "netboard"
PUBLIC = (
    *("base/tables", "physics", "physics/*", "task/trials", "task/journal", "stage", "participants"),
    *("network/protocol", "analysis/measures", "analysis/statistics"),
)
MODULES = sorted(
    [path for folder in PUBLIC for path in SOURCE.glob(f"{folder}/*.py")]
    + [SOURCE / "base" / name for name in ("config.py", "settings.py", "errors.py")]
)

QUANTITY = re.compile(r"\b(float|int|NDArray|ndarray)\b")
TEXT = re.compile(r"\bstr \||\| str\b")
RECORDS = re.compile(r"\b(ndarray|array|row) of [A-Z]+\b|\b[A-Z]+ (record|row)\b")
UNIT = re.compile(r"\[[^\[\]]+\]\.?$")
HEADER = re.compile(r"^(\w[\w ]*)\n-{3,}$", re.MULTILINE)
Function = ast.FunctionDef | ast.AsyncFunctionDef
Described = dict[str, tuple[str, str]]


def sections(docstring: str) -> dict[str, str]:
    """Split a numpydoc text by its headers; the text before the first is the summary."""
    parts = HEADER.split(docstring)
    return {"summary": parts[0].strip(), **dict(zip(parts[1::2], parts[2::2], strict=True))}


def entries(section: str) -> Iterator[tuple[tuple[str, ...], str, str]]:
    """Names, type and description of each entry of a section."""
    for block in re.split(r"\n(?=\S)", section.strip("\n")):
        head, _, body = block.partition("\n")
        names, _, kind = head.partition(" : ")
        yield tuple(name.strip().lstrip("*") for name in names.split(",")), kind, " ".join(body.split())


def is_quantity(annotation: str) -> bool:
    return bool(QUANTITY.search(annotation)) and not TEXT.search(annotation)


def is_public(name: str) -> bool:
    return not name.startswith("_")


def decorators(node: Function | ast.ClassDef) -> str:
    return " ".join(ast.unparse(decorator) for decorator in node.decorator_list)


def described_in(section: str) -> Described:
    """Type and description of each name of a section."""
    return {name: (kind, text) for names, kind, text in entries(section) for name in names}


def shared_of(path: Path) -> Described:
    """What the packages round a module describe for all their functions."""
    found: Described = {}
    for folder in (path.parent.parent, path.parent):
        package = folder / "__init__.py"
        docstring = ast.get_docstring(ast.parse(package.read_text(encoding="utf-8"))) if package.exists() else None
        found |= described_in(sections(docstring or "").get("Parameters", ""))
    return found


def check_entries(where: str, section: str, annotations: dict[str, str], shared: Described) -> Iterator[str]:
    """Complain about what a section leaves out, and about quantities without a unit."""
    described = shared | described_in(section)
    for name, annotation in annotations.items():
        if name not in described:
            yield f"{where}: {name} is not described"
            continue
        kind, text = described[name]
        if is_quantity(annotation) and not RECORDS.search(kind) and not UNIT.search(text):
            yield f"{where}: {name} has no [unit] at its end: {text!r}"


def check_function(where: str, node: Function, shared: Described) -> Iterator[str]:
    docstring = ast.get_docstring(node)
    if not docstring:
        yield f"{where}: no docstring"
        return
    parts = sections(docstring)
    arguments = [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs, node.args.vararg, node.args.kwarg]
    annotations = {
        argument.arg: ast.unparse(argument.annotation) if argument.annotation else ""
        for argument in arguments
        if argument is not None and argument.arg not in ("self", "cls")
    }
    yield from check_entries(where, parts.get("Parameters", ""), annotations, shared)
    returned = ast.unparse(node.returns) if node.returns else ""
    if not is_quantity(returned):
        return
    section = parts.get("Returns", parts.get("Yields", ""))
    if section:
        for names, kind, text in entries(section):
            if not RECORDS.search(kind or names[0]) and not UNIT.search(text):
                yield f"{where}: what is returned has no [unit] at its end: {text!r}"
    elif not UNIT.search(parts["summary"].split("\n\n")[0]):
        yield f"{where}: a quantity is returned, and neither Returns nor the summary gives its [unit]"


def check_class(where: str, node: ast.ClassDef, shared: Described) -> Iterator[str]:
    docstring = ast.get_docstring(node)
    if not docstring:
        yield f"{where}: no docstring"
        return
    fields = {
        item.target.id: ast.unparse(item.annotation)
        for item in node.body
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name) and is_public(item.target.id)
    }
    described_elsewhere = any("__pydantic_config__" in ast.unparse(item) for item in node.body)
    if "dataclass" in decorators(node) and not described_elsewhere:
        parts = sections(docstring)
        yield from check_entries(where, parts.get("Attributes", parts.get("Parameters", "")), fields, {})
    for item in node.body:
        if isinstance(item, Function) and is_public(item.name) and ".setter" not in decorators(item):
            yield from check_function(f"{where}.{item.name}", item, shared)


def complaints(text: str, shared: Described | None = None) -> list[str]:
    """Everything that is wrong with the docstrings of a module."""
    module = ast.parse(text)
    found = [] if ast.get_docstring(module) else ["the module has no docstring"]
    for node in module.body:
        if isinstance(node, Function) and is_public(node.name):
            found += check_function(node.name, node, shared or {})
        elif isinstance(node, ast.ClassDef) and is_public(node.name):
            found += check_class(node.name, node, shared or {})
    return found


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(SOURCE)))
def test_module_is_documented_with_units(path: Path) -> None:
    assert complaints(path.read_text(encoding="utf-8"), shared_of(path)) == []


GOOD = '''"""A module."""
@dataclass
class Ball:
    """A ball.

    Attributes
    ----------
    p, v : float
        Position and rate [m, m/s].
    name : str
        Its name.
    """
    p: float
    v: float
    name: str
    @property
    def energy(self) -> float:
        """Kinetic energy [J]."""
def step(ball: Ball, h: float) -> float:
    """Move it.

    Parameters
    ----------
    ball : Ball
        The ball.
    h : float
        Step [s].

    Returns
    -------
    float
        New position [m].
    """
'''


def test_complete_module_has_no_complaints() -> None:
    assert complaints(GOOD) == []


@pytest.mark.parametrize(
    ("right", "wrong", "complaint"),
    [
        ('"""A module."""', "", "the module has no docstring"),
        ("[m, m/s]", "", "Ball: p has no [unit]"),
        ("    name : str\n        Its name.\n", "", "Ball: name is not described"),
        ("Kinetic energy [J].", "Kinetic energy.", "Ball.energy: a quantity is returned"),
        ("Step [s].", "Step.", "step: h has no [unit]"),
        ("    h : float\n        Step [s].\n", "", "step: h is not described"),
        ("New position [m].", "New position.", "step: what is returned has no [unit]"),
    ],
)
def test_missing_docstring_description_or_unit_is_reported(right: str, wrong: str, complaint: str) -> None:
    assert right in GOOD
    assert complaint in "\n".join(complaints(GOOD.replace(right, wrong)))


@pytest.mark.parametrize(("description", "complaint"), [("Step [s].", None), ("Step.", "step: h has no [unit]")])
def test_description_in_the_package_applies_to_its_functions(description: str, complaint: str | None) -> None:
    text = GOOD.replace("    h : float\n        Step [s].\n", "")
    found = complaints(text, {"h": ("float", description)})
    assert complaint in "\n".join(found) if complaint else found == []
