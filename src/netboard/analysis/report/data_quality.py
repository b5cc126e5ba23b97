"""Quality section of a report: recordings, quality flags, exclusions, and unusual attempts."""

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from netboard.analysis.extraction.exclusions import flags_of
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.report.grids import Cell, CellLink, Grid, GridColumn, code, grid, grid_of, name, number
from netboard.analysis.report.trials import anchors, flag_words, reasons
from netboard.analysis.report.wording import amount, plural
from netboard.task.trials.quality import FLAGS

UNUSUAL = 5
"""Number of unusual attempts of each kind that are shown [1]."""

_KINDS = (
    ("completion", "longest completion time", "s"),
    ("peaks", "most velocity peaks", ""),
    ("overshoots", "most overshoots", ""),
    ("attempt", "most attempts before it", ""),
)


def data_quality(study: StudyData, left_out: Sequence[Mapping[str, str]]) -> dict[str, list[str] | Grid]:
    """Return the sentences and the tables of the quality section, by their names in the page template."""
    return {
        "sentences": _sentences(study, len(left_out)),
        "recordings": _recordings(study),
        "flags": _flags(study),
        "causes": _causes(study),
        "excluded": _excluded(study),
        "unusual": _unusual(study),
        "left_out": grid(
            "Files that are left out of this study",
            [code("File"), GridColumn("Why")],
            [(str(one["file"]), str(one["why"])) for one in left_out],
        ),
    }


def _sentences(study: StudyData, left_out: int) -> list[str]:
    blocks, trials = study.blocks, study.trials
    planned, done = _blocks(study)
    missing, there = int(blocks["missing"].sum()), int(blocks["ticks"].sum())
    unknown = int(blocks["unknown_rendered"].sum())
    unrendered = f"what a device rendered is unknown at {plural(unknown, 'tick')}; " if unknown else ""
    share = f" ({amount(100 * missing / (missing + there))} %)" if missing else ""
    ends = [f"{amount(n)} {str(end).replace('_', ' ')}" for end, n in trials["outcome"].value_counts().items()]
    marked = int((trials["flags"] != "").sum())
    return [
        f"{plural(len(blocks), 'recording')}: {amount(int((done >= planned).sum()))} of "
        f"{plural(len(planned), 'analysed block')} complete; {amount(missing)} of {plural(missing + there, 'tick')} "
        f"missing{share}; {unrendered}{plural(int(blocks['repaired'].sum()), 'recording')} repaired; "
        f"{plural(left_out, 'file')} left out.",
        f"{plural(len(trials), 'attempt')}: {', '.join(ends)}; {amount(marked)} with quality flags; "
        f"{amount(len(reasons(study)))} excluded.",
    ]


def _blocks(study: StudyData) -> tuple[pd.Series, pd.Series]:
    """Return planned and completed trials of each analysed block, which may have several recordings.

    Blocks for practice often end after a time and not after their trials, so they are never complete.
    """
    key = ["dyad", "session", "block"]
    done = study.trials.assign(done=study.trials["outcome"] == "success").groupby("recording")["done"].sum()
    analysed = study.analysed
    blocks = analysed.assign(done=analysed["recording"].map(done).fillna(0))
    grouped = blocks.groupby(key)
    return grouped["trials"].max(), grouped["done"].sum()


def _recordings(study: StudyData) -> Grid:
    of_each = dict(list(study.trials.groupby("recording")))
    out = pd.Series([recording for recording, _, _ in reasons(study)], dtype=object).value_counts()
    rows: list[dict[GridColumn, Cell | float]] = []
    for place, block in enumerate(study.blocks.to_dict("records"), start=1):
        mine = of_each.get(block["recording"], study.trials.iloc[:0])
        ends = mine["outcome"].value_counts()
        flags = mine["flags"].str.split().explode().dropna().value_counts()
        rows.append(
            {
                name("Recording"): CellLink(block["recording"], f"r{place}"),
                number("Duration (s)"): block["duration"],
                number("Ticks missing"): block["missing"],
                GridColumn("State"): "repaired" if block["repaired"] else "whole",
                number("Trials done"): f"{int(ends.get('success', 0))} of {block['trials']}",
                number("Attempts"): len(mine),
                number("Fell"): int(ends.get("fell", 0)),
                number("Timed out"): int(ends.get("timed_out", 0)),
                GridColumn("Quality flags"): ", ".join(
                    f"{flag_words(str(flag))}: {n}" for flag, n in sorted(flags.items())
                ),
                number("Excluded"): int(out.get(block["recording"], 0)),
            }
        )
    return grid_of("Content of each recording, and what it lacks", rows)


def _flags(study: StudyData) -> Grid:
    trials = study.trials
    out = set(reasons(study))
    keys = list(zip(trials["recording"], trials["trial"], trials["attempt"], strict=True))
    rules = study.readings.exclusions
    excluding_flags = {flag for block in study.blocks.to_dict("records") for flag in flags_of(rules, block)}
    rows = []
    for word, meaning in FLAGS.items():
        has = [word in str(flags).split() for flags in trials["flags"]]
        n = sum(has)
        if n:
            gone = sum(key in out for key, marked in zip(keys, has, strict=True) if marked)
            excludes = "yes" if word in excluding_flags else "no"
            rows.append((flag_words(word), n, gone, excludes, meaning))
    columns = [
        GridColumn("Flag"),
        number("Attempts"),
        number("Of these excluded"),
        GridColumn("Excludes"),
        GridColumn("Meaning"),
    ]
    caption = "Quality flags. “stuck” excludes no attempt of a simulated participant, whose hand may be still."
    return grid(caption, columns, rows)


def _causes(study: StudyData) -> Grid:
    counts = study.exclusions["why"].value_counts()
    columns = [name("Why"), number("Attempts")]
    return grid("Reasons for exclusion; an attempt may have several", columns, [*counts.items()])


def _excluded(study: StudyData) -> Grid:
    known = anchors(study)
    rows = [
        (CellLink(file, known[file, trial, n]) if (file, trial, n) in known else file, trial, n, "; ".join(why))
        for (file, trial, n), why in sorted(reasons(study).items())
    ]
    columns = [name("Recording"), number("Trial"), number("Attempt"), name("Why")]
    return grid("All excluded attempts, with all reasons", columns, rows)


def _unusual(study: StudyData) -> Grid:
    known = anchors(study)
    done = study.trials[study.trials["outcome"] == "success"]
    rows: list[tuple[Any, ...]] = []
    for column, what, unit in _KINDS:
        top = done[done[column] > (1 if column == "attempt" else 0)].nlargest(UNUSUAL, column)
        for row in top.to_dict("records"):
            recording, trial, attempt = row["recording"], int(row["trial"]), int(row["attempt"])
            link = CellLink(recording, known[recording, trial, attempt])
            value = row[column] - 1 if column == "attempt" else row[column]
            text = f"{amount(value)} {unit}".strip()
            rows.append((what, text, link, trial, attempt, "yes" if row["counts"] else "no"))
    columns = [
        GridColumn("What"),
        number("How much"),
        name("Recording"),
        number("Trial"),
        number("Attempt"),
        GridColumn("Counts"),
    ]
    return grid("The most unusual successful attempts: inspect them before you draw conclusions", columns, rows)
