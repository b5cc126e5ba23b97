"""The evidence for each measure, from the marks of its tests; the sources are parsed, no test runs.

    @pytest.mark.evidence("truth", delays)
    @pytest.mark.evidence("independent", lag_of, by="scipy")
    @pytest.mark.evidence("properties", delays, contributions, of=("time", "mirror"))
    @pytest.mark.evidence("disturbance", delays)

The page docs/explanation/analysis-evidence.md is generated from it, and test_analysis_evidence.py fails if evidence is
missing.
"""

import ast
from dataclasses import dataclass
from pathlib import Path

TESTS = Path(__file__).parent
PACKAGE = TESTS.parent.parent / "src" / "netboard" / "analysis"
ROOMS = ("measures", "statistics")
PLACES = tuple(f"netboard.analysis.{room}." for room in ROOMS)

KINDS = {
    "truth": (),
    "independent": (
        "numpy",
        "scipy",
        "scikit-learn",
        "statsmodels",
        "pandas",
        "monalysa",
        "statistics",
        "lme4",
        "lmerTest",
        "pbkrtest",
        "brglm2",
    ),
    "properties": ("time", "mirror", "unit", "constant", "rate", "order", "balance"),
    "disturbance": ("noise", "holes"),
}
"""Kinds of evidence, and the details that a mark may name."""

DETAILS = {"independent": "by", "properties": "of", "disturbance": "of"}
"""Name of the argument that holds the details."""

CHECKS = "only checks its arguments"
NO_SAMPLES = "takes no samples"
PART = "part of the models: tested with them"
COMMON = "part of all statistics: tested with them"
WITHOUT = {
    **{("signals.paired", kind): CHECKS for kind in ("truth", "properties", "disturbance")},
    **{
        (name, kind): PART
        for name in (
            *(
                "effects.effects_of",
                "effects.contrasts_of",
                "effects.between_dyad_freedom",
                "effects.unique",
                "effects.diagnose",
            ),
            *("factors.design_of", "factors.paper_factors", "factors.simple_effects", "factors.cells_of"),
            *("factors.interaction", "effects.interval_effect", "random_effects.residual_deviation"),
            *("random_effects.reduced_fit",),
            *("random_effects.random_effects", "random_effects.mixed_model", "marginal.marginal_model"),
            *("marginal.over_dispersed_model", "marginal.extreme_condition", "marginal.penalised_model"),
            *("specification.too_few_trials", "specification.too_few_events", "specification.with_notes"),
        )
        for kind in ("truth", "properties", "disturbance")
    },
    **{
        (f"estimates.{name}", kind): COMMON
        for name in ("known", "mean", "difference", "constant")
        for kind in ("truth", "properties", "disturbance")
    },
    **{
        (f"firth.{name}", "disturbance"): "the models leave out trials without a value"
        for name in ("firth_fit", "profile_interval")
    },
    ("restricted.restricted_fit", "disturbance"): "the models leave out trials without a value",
    **{
        (
            f"small_samples.{name}",
            "disturbance",
        ): "the models leave out trials without a value"
        for name in ("satterthwaite_freedom", "kenward_roger_freedom", "kenward_roger_covariance")
    },
    ("contrasts.holm", "properties"): "returns p-values in the order of its input",
    ("contrasts.holm", "disturbance"): NO_SAMPLES,
    ("contrasts.gatekept", "disturbance"): NO_SAMPLES,
    ("exact_tests.least_permutation_p", "disturbance"): NO_SAMPLES,
    ("exact_tests.least_permutation_p", "properties"): "takes one integer",
    ("estimates.wilson_interval", "disturbance"): NO_SAMPLES,
    ("detection.d_prime", "disturbance"): NO_SAMPLES,
    ("detection.clustered_d_prime", "disturbance"): NO_SAMPLES,
    ("signals.runs", "disturbance"): "takes Boolean values; the caller decides about gaps",
    ("signals.lasting", "disturbance"): "takes Boolean values; the caller decides about gaps",
    ("signals.lasts", "disturbance"): NO_SAMPLES,
    ("signals.ticks_of", "disturbance"): NO_SAMPLES,
    ("performance.running_number", "disturbance"): "takes labels, no samples",
    ("performance.window_sizes", "disturbance"): NO_SAMPLES,
    ("ellipses.groups_of", "disturbance"): "takes trial numbers, no samples",
    ("task.falls", "disturbance"): "takes outcomes, no samples",
    ("effect_sizes.hedges_factor", "disturbance"): NO_SAMPLES,
    ("effect_sizes.hedges_factor", "properties"): "takes one integer",
}
"""Kinds of evidence that a function does not need, and the reason."""


@dataclass(frozen=True)
class Evidence:
    """Evidence for a function that a test gives."""

    function: str
    kind: str
    words: tuple[str, ...]
    file: str
    test: str


def public_functions() -> dict[str, list[str]]:
    """List public functions, and classes with callable instances, by module."""
    found = {}
    for path in sorted((path for room in ROOMS for path in (PACKAGE / room).glob("*.py")), key=lambda path: path.stem):
        nodes = ast.parse(path.read_text(encoding="utf-8")).body
        names = [node.name for node in nodes if _is_measure(node)]  # type: ignore[attr-defined]
        if names:
            found[path.stem] = names
    return found


def _is_measure(node: ast.stmt) -> bool:
    if isinstance(node, ast.ClassDef):
        return any(isinstance(item, ast.FunctionDef) and item.name == "__call__" for item in node.body)
    return isinstance(node, ast.FunctionDef) and not node.name.startswith("_")


def all_evidence() -> list[Evidence]:
    """Return the evidence marks of all tests in this folder."""
    return [one for path in sorted(TESTS.glob("test_*.py")) for one in _evidence_in(path)]


def _evidence_in(path: Path) -> list[Evidence]:
    """Return the evidence marks in one file."""
    nodes = ast.parse(path.read_text(encoding="utf-8")).body
    modules = {
        alias.asname or alias.name: f"{node.module.rpartition('.')[2]}.{alias.name}"
        for node in nodes
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith(PLACES)
        for alias in node.names
    }
    found = []
    for node in nodes:
        for mark in node.decorator_list if isinstance(node, ast.FunctionDef) else ():
            if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.evidence":
                kind, *functions = mark.args
                of = ast.literal_eval(kind)
                given = [ast.literal_eval(keyword.value) for keyword in mark.keywords if keyword.arg == DETAILS.get(of)]
                words = tuple(word for one in given for word in ([one] if isinstance(one, str) else one))
                found += [Evidence(modules[ast.unparse(one)], of, words, path.name, node.name) for one in functions]
    return found


def table() -> str:
    """Write the number of functions with each kind of evidence, then a section for each module."""
    evidence = all_evidence()
    sections = [_counts(evidence)]
    for module, names in public_functions().items():
        lines = [f"## {module}", "", "| | " + " | ".join(KINDS) + " |", "|---|" + "---|" * len(KINDS)]
        for name in names:
            cells = [_cell(f"{module}.{name}", kind, evidence) for kind in KINDS]
            lines.append(f"| **`{name}`** | " + " | ".join(cells) + " |")
        sections.append("\n".join(lines))
    return "\n\n".join(sections)


def _counts(evidence: list[Evidence]) -> str:
    """Count the functions with each kind of evidence, and the tests."""
    functions = sum(map(len, public_functions().values()))
    counts = [f"{kind} for {len({one.function for one in evidence if one.kind == kind})}" for kind in KINDS]
    tests = len({(one.file, one.test) for one in evidence})
    return f"{functions} functions; evidence from {tests} tests: {', '.join(counts)}."


def _cell(function: str, kind: str, evidence: list[Evidence]) -> str:
    """List the tests that give this kind of evidence for a function, each after the details of its mark."""
    own = [one for one in evidence if (one.function, one.kind) == (function, kind)]
    if not own:
        return WITHOUT.get((function, kind), "-")
    return "; ".join(f"{_words(one)}[{_sentence(one.test)}](../../tests/analysis/{one.file})" for one in own)


def _words(one: Evidence) -> str:
    return f"**{', '.join(one.words)}**: " if one.words else ""


def _sentence(test: str) -> str:
    """Turn the name of a test into a phrase."""
    return test.removeprefix("test_").replace("_", " ")
