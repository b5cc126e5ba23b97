"""The figures of the additional measures show the results, read back from the drawn artists."""

import re
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text

from made_modern import Path, modern_blocks, modern_study, with_paths
from made_study import Block, declared, made_study, random_block, times
from netboard.analysis.extraction.settings import Readings
from netboard.analysis.extraction.study import StudyData, study_of
from netboard.analysis.topics import contrasts, delay, influence, models, pushes
from netboard.analysis.topics.contrasts import comparisons
from netboard.analysis.topics.controls import controls
from netboard.analysis.topics.controls import picture as draw_controls
from netboard.analysis.topics.everything import MODERN as FOUND
from netboard.analysis.topics.everything import MODERN_FIGURES as MODERN
from netboard.analysis.topics.figure import TopicFigure, as_bytes
from netboard.analysis.topics.influence import influences
from netboard.analysis.topics.leadership import leaders
from netboard.analysis.topics.measures import overview
from netboard.analysis.topics.models import fits
from netboard.analysis.topics.paths import mean_paths
from netboard.analysis.topics.quality import quality as find_quality
from netboard.analysis.topics.result import table_of
from netboard.analysis.topics.units import read_in
from netboard.base.looks import FIGURE_STYLE
from netboard.base.tables.experiment import Design

FORCES = ("full", "partner_only", "environment_only", "none", "unrelated")
NAMES = [draw.__module__.rpartition(".")[2] for draw in MODERN]

# The studies here have no perturbation trials: tests/analysis/test_pushes_findings.py has some.
SHOWN = [name for name in NAMES if name != "pushes"]
SHOWN_FIGURES = [draw for draw in MODERN if draw is not pushes.picture]
SHOWN_TOPICS = [find for find in FOUND if find is not pushes.pushes]
UNIT = re.compile(r"\[[^\]]+\]")


def any_path(trial: pd.Series) -> Path:
    """Return a random path that is reproducible."""
    chance = np.random.default_rng([int(trial["order"]), len(trial["performer"])])
    names = ("left_z", "right_z", "left_vz", "right_vz", "theta", "p", "speed")
    count = round(trial["duration"] / 0.02)
    return {name: 0.01 * values for name, values in zip(names, chance.normal(size=(7, count)), strict=True)}


@pytest.fixture(scope="module")
def study() -> StudyData:
    return with_paths(modern_study(modern_blocks(trials=5)), any_path)


@pytest.fixture(scope="module")
def unusual() -> StudyData:
    """Five forces, and a robot and a still hand as partners."""
    chance = np.random.default_rng(1)
    others = [
        random_block(chance, "D01", "D01", "dyadic", force, 3, partner)
        for partner in ("robot", "still")
        for force in ("full", "none")
    ]
    return with_paths(modern_study([*modern_blocks(dyads=3, trials=3, forces=FORCES), *others]), any_path)


@pytest.fixture(scope="module")
def drawn(study: StudyData) -> dict[str, TopicFigure]:
    """All figures by name."""
    return {picture.name: picture for picture in (draw(study) for draw in MODERN)}


def figure_of(picture: TopicFigure) -> Figure:
    assert picture.figure is not None
    return picture.figure


def points(axes: Axes, label: str) -> np.ndarray:
    """Points of the only line with this label, shape (n, 2)."""
    (only,) = [line for line in axes.lines if line.get_label() == f"_{label}"]
    return np.column_stack(only.get_data())


def panel(picture: TopicFigure, title: str) -> Axes:
    titles = {axes: axes.get_title("left").replace("\n", " ") for axes in figure_of(picture).axes}
    (only,) = [axes for axes, found in titles.items() if found.endswith(title)]
    return only


@pytest.mark.slow
@pytest.mark.parametrize("name", SHOWN)
def test_every_numeric_axis_has_a_unit(name: str, drawn: dict[str, TopicFigure]) -> None:
    figure = figure_of(drawn[name])
    labels = [axis.get_label_text() for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    numbers = [label for label in labels if label not in ("", "dyad")]
    assert numbers
    assert all(UNIT.search(label) for label in numbers)


@pytest.mark.parametrize("name", SHOWN)
def test_captions_state_the_number_of_dyads(name: str, drawn: dict[str, TopicFigure]) -> None:
    assert re.search(r"n = 4|of 4 dyads", drawn[name].caption)


def test_figures_are_named_after_their_modules(drawn: dict[str, TopicFigure]) -> None:
    assert list(drawn) == NAMES


@pytest.mark.parametrize("name", ["measures", "differences"])
def test_titles_of_small_panels_are_no_wider_than_the_panel(name: str, drawn: dict[str, TopicFigure]) -> None:
    figure = figure_of(drawn[name])
    with mpl.rc_context(FIGURE_STYLE):
        figure.draw_without_rendering()
        for axes in figure.axes:
            words = axes.get_title("left")
            (title,) = [text for text in axes.get_children() if isinstance(text, Text) and text.get_text() == words]
            assert title.get_window_extent().x1 <= axes.bbox.x1 + 1.0, title.get_text()


@pytest.fixture(scope="module")
def masses() -> StudyData:
    """Dyads with balls of three masses: a factor that makes the names of conditions long."""
    found, chance = [], np.random.default_rng(3)
    names, values = ("light", "middle", "heavy"), (0.02, 0.05, 0.08)
    for dyad in ("D01", "D02", "D03"):
        for name in names:
            block = random_block(chance, dyad, dyad, "dyadic", "full", 10, f"{dyad}B")
            design = Design(
                factors={"mass": name},
                levels={"mass": names},
                types={"mass": "numeric"},
                units={"mass": "kg"},
                values={"mass": values},
            )
            found.append(declared(block, len(found) + 1, design))
    return with_paths(study_of(found, Readings()), any_path)


@pytest.mark.parametrize("draw", [delay.picture, influence.picture])
def test_names_of_conditions_do_not_overlap(draw: Callable[[StudyData], TopicFigure], masses: StudyData) -> None:
    figure = figure_of(draw(masses))
    with mpl.rc_context(FIGURE_STYLE):
        figure.draw_without_rendering()
        for axes in figure.axes:
            shown = [label for label in axes.get_xticklabels() if label.get_visible() and not label.get_rotation()]
            boxes = [label.get_window_extent() for label in shown if label.get_text()]
            assert all(one.x1 < next_one.x0 for one, next_one in pairwise(boxes)), [one.get_text() for one in shown]


def test_axis_of_ratios_has_several_ticks_in_a_narrow_range(masses: StudyData) -> None:
    axes = figure_of(models.picture(masses)).axes[0]
    low, high = axes.get_xlim()
    assert high < 3 * low
    assert sum(low <= tick <= high for tick in axes.get_xticks()) >= 3


@pytest.mark.parametrize("draw", [influence.picture, draw_controls])
def test_figures_are_reproducible_to_the_byte(
    draw: Callable[[StudyData], TopicFigure], drawn: dict[str, TopicFigure], study: StudyData
) -> None:
    again = draw(study)
    assert as_bytes(figure_of(again), "svg") == as_bytes(figure_of(drawn[again.name]), "svg")


@pytest.mark.slow
@pytest.mark.parametrize("draw", SHOWN_FIGURES)
@pytest.mark.sampled(1)
def test_unusual_studies_are_drawn(draw: Callable[[StudyData], TopicFigure], unusual: StudyData) -> None:
    assert as_bytes(figure_of(draw(unusual)), "png").startswith(b"\x89PNG")


@pytest.mark.slow
@pytest.mark.parametrize("draw", MODERN)
@pytest.mark.parametrize("trials", [[], times(3.0), [{"outcome": "fell"}]])
@pytest.mark.sampled(9)
def test_figure_that_cannot_be_drawn_states_the_reason(
    draw: Callable[[StudyData], TopicFigure], trials: list[dict[str, float]]
) -> None:
    picture = draw(made_study([Block("D01", "D01", "dyadic", "full", trials)]))
    assert picture.caption
    if picture.figure is not None:
        as_bytes(picture.figure, "png")


@pytest.mark.slow
@pytest.mark.parametrize("find", SHOWN_TOPICS)
@pytest.mark.sampled(1)
def test_results_of_unusual_studies_have_units_and_notes(
    find: Callable[[StudyData], object], unusual: StudyData
) -> None:
    table = table_of(find(unusual).results)  # type: ignore[attr-defined]
    assert len(table)
    assert not table.duplicated(["topic", "quantity", "group"]).any()
    assert (table["unit"] != "").all()
    assert (table["of"] != "").all()
    assert (table.loc[table["value"].isna() | (table["n"] == 0), "note"] != "").all()


def test_measures_figure_shows_the_levels(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    picture = drawn["measures"]
    for one in overview(study).parts:
        axes, unit = panel(picture, one.measure.name), read_in(one.measure.unit, one.measure.name)
        assert axes.get_ylabel() == unit.in_brackets
        assert points(axes, one.condition.name)[:, 1] == pytest.approx([unit.scale * one.mean.value])
        ends = [unit.scale * one.mean.low, unit.scale * one.mean.high]
        assert points(axes, f"{one.condition.name}, interval")[:, 1] == pytest.approx(ends)
        dyads = [points(axes, f"{dyad} {one.condition.team}")[:, 1] for dyad in one.dyads]
        assert all(unit.scale * value in own for own, value in zip(dyads, one.values, strict=True))


@pytest.mark.slow
def test_contrasts_figure_shows_effect_sizes_and_p(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    picture = drawn["contrasts"]
    assert "assumes that the differences are distributed symmetrically" in picture.caption
    axes = dict(zip(("forces", "configuration", "interaction"), figure_of(picture).axes, strict=True))
    names = [label.get_text() for label in axes["forces"].get_yticklabels()]
    for one in comparisons(study).parts:
        if not np.isfinite(one.hedges.value):
            assert one.measure.name == "falls per attempt"
            continue
        own, label = axes[one.question.kind], f"{one.measure.name}: {one.question.name}"
        ((value, row),) = points(own, label)
        assert value == one.hedges.value
        assert names[round(row)] == one.measure.name
        assert points(own, f"{label}, interval")[:, 0] == pytest.approx([one.hedges.low, one.hedges.high])
        written = [text.get_text() for text in own.texts if text.get_position()[1] == row]
        assert written == [f"{one.contrast.permutation.p:.3g}"]
    assert "smallest possible p of one test is 0.125" in picture.caption
    assert "exact permutation tests, exploratory and not corrected" in picture.caption


def test_differences_figure_shows_the_dyads(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    picture = drawn["differences"]
    for one in comparisons(study).parts:
        axes = panel(picture, one.measure.name)
        unit = read_in(one.unit, one.what)
        assert axes.get_ylabel().endswith(unit.in_brackets)
        each = np.array(one.contrast.differences)
        shown = points(axes, f"{one.question.name}, dyads")[:, 1]
        np.testing.assert_allclose(shown, np.exp(each) if one.measure.ratio else unit.scale * each)
        assert points(axes, one.question.name)[:, 1] == pytest.approx([unit.scale * one.difference.value])


def test_models_figure_shows_ratios_and_residuals(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    picture, found = drawn["models"], fits(study)
    terms = panel(picture, "ratios of the models' terms")
    shown = [fit for fit in found.fits if fit.model.fitted]
    assert shown
    for fit in shown:
        for effect in models.effects_shown(fit):
            assert points(terms, f"{fit.measure}: {effect.name}")[0, 0] == effect.ratio.value
    diagnostics = shown[0].model.diagnostics
    assert diagnostics is not None
    residuals = points(panel(picture, "residuals, completion time"), "residuals")
    np.testing.assert_array_equal(residuals, np.column_stack([diagnostics.quantiles, diagnostics.residuals]))


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_models_of_one_condition_are_not_drawn() -> None:
    dyadic = [block for block in modern_blocks(dyads=2, trials=4, forces=("full",)) if block.configuration == "dyadic"]
    picture = models.picture(modern_study(dyadic))
    assert picture.figure is None
    assert picture.caption.startswith("No model has more than one condition. Completion time: haptics: left out")


def test_leadership_figure_is_signed_and_centred_on_zero(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    picture = drawn["leadership"]
    for lead in leaders(study).parts:
        axes, scale = panel(picture, f"  {lead.measure.name}"), 1000.0 if lead.measure.unit == "s" else 1.0
        assert points(axes, lead.condition.name)[:, 1] == pytest.approx([scale * lead.mean.value])
        low, high = axes.get_ylim()
        assert low == -high


def test_influence_figure_shows_dyads_and_surrogates(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    axes = figure_of(drawn["influence"]).axes[0]
    lines = {line.get_label(): line.get_ydata() for line in axes.lines}
    for place, one in enumerate(influences(study).parts):
        name = f"_{one.condition.name}, {one.direction}"
        assert one.chance is not None
        names = f"{name}, dyads", f"{name}, surrogates"
        if not place:
            names = "a dyad", "mean of a pairing of surrogate dyads"
        np.testing.assert_array_equal(lines[names[0]], one.values)
        np.testing.assert_array_equal(lines[names[1]], one.chance.surrogates)


def test_influence_caption_says_whether_all_exchanges_were_made(
    study: StudyData, drawn: dict[str, TopicFigure]
) -> None:
    assert "share of all exchanges of partners" in drawn["influence"].caption
    some = [replace(one, chance=replace(one.chance, exact=False)) for one in influences(study).parts if one.chance]
    assert "share of randomly drawn exchanges of partners" in influence._caption(some)


def test_controls_figure_shows_effects_and_their_parts(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    figure = figure_of(drawn["controls"])
    found = [one for one in controls(study).parts if one.passive]
    assert {axes.get_title(loc="left") for axes in figure.axes} == {one.measure.name for one in found}
    (axes,) = [axes for axes in figure.axes if axes.get_title(loc="left") == "cooperative share"]
    for one in found:
        if one.measure.name == "cooperative share":
            assert points(axes, f"{one.group}, effect")[0, 0] == pytest.approx(100 * one.effect.value)
            for each in one.usual:
                assert each.arm is not None
                for part, mean in (("passive part", each.predicted), ("rest", each.rest)):
                    shown = points(axes, f"{one.group}, {part}, {each.arm.name}")[0, 0]
                    assert shown == pytest.approx(100 * mean.value)
    assert "filled: with the mass and friction of the recorded device" in drawn["controls"].caption


def test_paths_figure_shows_means_and_bands(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    picture = drawn["paths"]
    for one in mean_paths(study).parts:
        means = [
            (axes, line)
            for axes in figure_of(picture).axes
            for line in axes.lines
            if line.get_label() == f"_{one.condition.name}, {one.quantity}"
        ]
        ((axes, line),) = means
        scale = 1000.0
        np.testing.assert_allclose(np.column_stack(line.get_data()), np.column_stack([one.time, scale * one.mean]))
        (band,) = [
            area for area in axes.collections if area.get_label() == f"_{one.condition.name}, {one.quantity}, trials"
        ]
        heights = band.get_paths()[0].vertices[:, 1]
        assert heights.min() == pytest.approx(scale * one.low.min())
        assert heights.max() == pytest.approx(scale * one.high.max())


def test_quality_figure_shows_every_block_and_dyad(study: StudyData, drawn: dict[str, TopicFigure]) -> None:
    blocks = find_quality(study).blocks
    picture = drawn["quality"]
    fell, excluded = (
        panel(picture, f"attempts {what} [1]").images[0].get_array() for what in ("that fell", "excluded")
    )
    assert np.nansum(fell) == blocks["fell"].sum()
    assert np.nansum(excluded) == blocks["excluded"].sum()
    times_of = panel(picture, "completion time through the session")
    for dyad, own in blocks.groupby("dyad"):
        np.testing.assert_array_equal(points(times_of, str(dyad)), own[["block", "time"]])
    assert set(times_of.get_xticks()) <= set(blocks["block"])


@pytest.mark.slow
def test_contrasts_of_two_dyads_are_not_drawn() -> None:
    """A regression: the effect size was drawn at exactly 0, with an interval from 0 to 0."""
    picture = contrasts.picture(modern_study(modern_blocks(dyads=2, trials=3)))
    assert picture.figure is None
    assert "three dyads" in picture.caption
