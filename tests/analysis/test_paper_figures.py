"""The paper's figures show the results, read back from the drawn artists."""

import re
from collections.abc import Callable, Iterator

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from made_study import SMALL, Block, made_study, random_block, random_blocks, times
from netboard.analysis.extraction.details import THRESHOLDS
from netboard.analysis.extraction.study import StudyData
from netboard.analysis.topics import classes, delay, dyads, learning, strategy
from netboard.analysis.topics.classes import classes as find_classes
from netboard.analysis.topics.delay import delay as find_delay
from netboard.analysis.topics.dyads import dyads as find_dyads
from netboard.analysis.topics.everything import PAPER_FIGURES as PAPER
from netboard.analysis.topics.everything import PICTURES, drawn
from netboard.analysis.topics.figure import TopicFigure, as_bytes
from netboard.analysis.topics.groups import CLASSES
from netboard.analysis.topics.learning import learning as find_learning
from netboard.analysis.topics.strategy import strategy as find_strategy

FORCES = ("full", "partner_only", "environment_only", "none", "unrelated")


@pytest.fixture(scope="module")
def study() -> StudyData:
    return made_study(random_blocks(), *SMALL)


@pytest.fixture(scope="module")
def unusual() -> StudyData:
    """Five forces, and a robot and a still hand as partners."""
    chance = np.random.default_rng(1)
    others = [
        random_block(chance, "D01", "D01", "dyadic", force, 7, partner)
        for partner in ("robot", "still")
        for force in ("full", "none")
    ]
    return made_study([*random_blocks(forces=FORCES), *others], *SMALL)


def figure_of(picture: TopicFigure) -> Figure:
    assert picture.figure is not None
    return picture.figure


def lines(axes: Axes, label: str) -> np.ndarray:
    """Points of the only line with this label, shape (n, 2)."""
    (only,) = [line for line in axes.lines if line.get_label() == label]
    return np.column_stack(only.get_data())


def panels(picture: TopicFigure) -> Iterator[Axes]:
    yield from figure_of(picture).axes


def titled(picture: TopicFigure, title: str) -> Axes:
    (only,) = [axes for axes in panels(picture) if axes.get_title("left").endswith(f"$  {title}")]
    return only


@pytest.mark.parametrize("draw", PAPER)
def test_every_axis_has_a_label_with_a_unit(draw: Callable[[StudyData], TopicFigure], study: StudyData) -> None:
    """Inner panels share the labels of the outer ones, and names of conditions need no unit."""
    for axes in panels(draw(study)):
        for axis in (axes.xaxis, axes.yaxis):
            names = [label.get_text() for label in axis.get_ticklabels()]
            numbered = all(re.fullmatch(r"[−\d.]*", name) for name in names)
            place = axes.get_subplotspec()
            outer = place is not None and (place.is_last_row() if axis is axes.xaxis else place.is_first_col())
            if (numbered and outer) or axis.get_label_text():
                assert re.search(r"\[[^\]]+\]$", axis.get_label_text())


@pytest.mark.parametrize("draw", PAPER)
def test_captions_state_n_and_the_kind_of_interval(draw: Callable[[StudyData], TopicFigure], study: StudyData) -> None:
    caption = draw(study).caption
    assert re.search(r"[Nn] = \d", caption)
    assert re.search(r"95 % confidence intervals \((t|Wilson|t on the log scale(; t)?)\)", caption)
    assert caption.endswith("Simulated participants: no evidence about people.")


@pytest.mark.slow
@pytest.mark.parametrize("draw", PAPER)
@pytest.mark.sampled(2)
def test_figures_are_reproducible_to_the_byte(draw: Callable[[StudyData], TopicFigure], study: StudyData) -> None:
    first, second = (as_bytes(figure_of(draw(study)), "svg") for _ in range(2))
    assert first == second


@pytest.mark.slow
@pytest.mark.parametrize("draw", PAPER)
@pytest.mark.sampled(2)
def test_study_with_other_conditions_is_drawn(draw: Callable[[StudyData], TopicFigure], unusual: StudyData) -> None:
    assert len(as_bytes(figure_of(draw(unusual)), "svg")) > 10_000


@pytest.mark.parametrize("draw", PAPER)
def test_figure_without_data_states_the_reason(draw: Callable[[StudyData], TopicFigure]) -> None:
    picture = draw(made_study([Block("D01", "D01", "dyadic", "none", [{"outcome": "fell"}])]))
    assert picture.figure is None
    assert picture.caption.startswith("No ")


@pytest.mark.slow
@pytest.mark.parametrize("draw", PAPER)
@pytest.mark.parametrize("trials", [1, 4])
@pytest.mark.sampled(3)
def test_single_dyad_with_few_trials_is_drawn_or_skipped(draw: Callable[[StudyData], TopicFigure], trials: int) -> None:
    picture = draw(made_study(random_blocks(dyads=1, trials=trials)))
    assert picture.figure is None or as_bytes(picture.figure, "svg")


@pytest.mark.slow
def test_figures_have_unique_names(study: StudyData) -> None:
    names = [drawn(study, draw).name for draw in PICTURES]
    assert len(set(names)) == len(names)
    assert names[:6] == ["primary", "learning", "dyads", "classes", "strategy", "delay"]


def test_learning_figure_shows_the_results(study: StudyData) -> None:
    picture = learning.picture(study)
    time, peaks = figure_of(picture).axes[0], figure_of(picture).axes[2]
    one = find_learning(study).parts[0]
    for axes, course in ((time, one.courses[0]), (peaks, one.courses[1])):
        np.testing.assert_allclose(lines(axes, "_each trial"), np.column_stack([course.curve.order, course.curve.mean]))
        drawn = [line.get_ydata()[0] for line in axes.lines if line.get_label() == "_dyads"]
        assert drawn == [mean.value for mean in course.stages.means]
        drawn_ends = [list(line.get_ydata()) for line in axes.lines if line.get_label() == "_dyads, interval"]
        np.testing.assert_allclose(drawn_ends, [[mean.low, mean.high] for mean in course.stages.means])
        np.testing.assert_allclose(lines(axes, "_D02")[:, 1], course.stages.dyads.loc["D02"])
        texts = [text.get_text() for text in axes.texts]
        assert f"{course.ends.first.mean:.2f} ± {course.ends.first.deviation:.2f}" in texts[0]


def test_stacked_areas_equal_the_class_durations(study: StudyData) -> None:
    axes = figure_of(learning.picture(study)).axes[0]
    one = find_learning(study).parts[0]
    tops = [area.get_paths()[0].vertices[:, 1].max() for area in axes.collections]
    stacked = np.cumsum([one.seconds[:, CLASSES.index(name)] for name in learning.STACK], axis=0)
    np.testing.assert_allclose(tops, stacked.max(axis=1))


def test_dyads_figure_shows_the_points(study: StudyData) -> None:
    axes = titled(dyads.picture(study), "completion time")
    for one in find_dyads(study).parts:
        if one.quantity.column == "completion":
            points = [(point.relative.against_partner, point.relative.of_dyad) for point in one.points]
            np.testing.assert_allclose(lines(axes, f"_{one.condition.force}"), points)
    diagonal = lines(axes, "_diagonal")
    np.testing.assert_array_equal(diagonal[:, 0], diagonal[:, 1])


@pytest.mark.slow
def test_dyads_figure_shows_the_gains(study: StudyData) -> None:
    axes = figure_of(dyads.picture(study)).axes[2]
    names = [label.get_text() for label in axes.get_yticklabels()]
    found = [one for one in find_dyads(study).parts if one.quantity.column == "completion"]
    for one, name in zip(found, names, strict=True):
        assert name == f"{one.condition.haptics}:\n{one.better} of {one.known} dyads better"
        ends = lines(axes, f"_{one.condition.force}, interval")[:, 0]
        np.testing.assert_allclose(ends, [one.gain.low, one.gain.high])
        values = [line.get_xdata() for line in axes.lines if line.get_label() == f"_{one.condition.force}"]
        np.testing.assert_allclose(values[0], one.gains)
        assert values[1][0] == one.gain.value


def test_class_bars_show_the_mean_shares(study: StudyData) -> None:
    axes = titled(classes.picture(study), "mean shares")
    widths = {bars.get_label(): bars.patches[0].get_width() for bars in axes.containers}
    begins = {bars.get_label(): bars.patches[0].get_x() for bars in axes.containers}
    for one in find_classes(study).parts:
        labels = [f"_{one.condition.name}: {name}" for name in classes.STACK]
        ends = np.cumsum([widths[label] for label in labels])
        np.testing.assert_allclose([begins[label] for label in labels], [0.0, *ends[:-1]], atol=1e-10)
        for name, mean in zip(CLASSES, one.means, strict=True):
            assert widths[f"_{one.condition.name}: {name}"] == pytest.approx(100 * mean.value)


def test_class_dots_show_means_intervals_and_dyads(study: StudyData) -> None:
    picture = classes.picture(study)
    for name in CLASSES:
        axes = titled(picture, name)
        for one in find_classes(study).parts:
            mean = one.means[CLASSES.index(name)]
            assert lines(axes, f"_{one.condition.name}")[0, 1] == pytest.approx(100 * mean.value)
            ends = lines(axes, f"_{one.condition.name}, interval")[:, 1]
            np.testing.assert_allclose(ends, [100 * mean.low, 100 * mean.high])
        off, on = (one for one in find_classes(study).parts if one.condition.team == "dyadic")
        np.testing.assert_allclose(
            lines(axes, "_D01 dyadic")[:, 1], [100 * one.dyads.loc["D01", name] for one in (off, on)]
        )


def test_strategy_figure_shows_ellipses_and_variances(study: StudyData) -> None:
    picture = strategy.picture(study)
    for team in find_strategy(study).parts:
        axes = titled(picture, "all participants and dyads" if team.team == "all" else team.team)
        for k, one in enumerate(team.ellipses):
            np.testing.assert_allclose(lines(axes, f"_{team.team}, group {k}"), 1e3 * one.outline())
            np.testing.assert_allclose(lines(axes, f"_{team.team}, centre {k}")[0], 1e3 * one.centre)
        if team.team != "all":
            for spread in team.spreads:
                own = titled(picture, spread.quantity)
                np.testing.assert_allclose(
                    lines(own, f"_{team.team}")[:, 1], [1e6 * mean.value for mean in spread.means]
                )
                np.testing.assert_allclose(lines(own, f"_D02 {team.team}")[:, 1], 1e6 * spread.dyads.loc["D02"])


def test_generalised_variance_has_its_own_panel() -> None:
    picture = strategy.picture(made_study(random_blocks(), *SMALL, 'summaries.variance="generalised"'))
    assert "[cm⁴/s²]" in titled(picture, "generalised variance").get_ylabel()


def test_delay_figure_shows_the_results(study: StudyData) -> None:
    axes = figure_of(delay.picture(study)).axes
    for one in find_delay(study).parts:
        for panel, found in zip(axes, (one.as_set, one.own_peak, one.signed), strict=True):
            for q, mean in zip(THRESHOLDS, found.means, strict=True):
                label = f"_{one.condition.name}, {q} %"
                assert lines(panel, label)[0, 1] == pytest.approx(1000 * mean.value)
                np.testing.assert_allclose(
                    lines(panel, f"{label}, interval")[:, 1], [1000 * mean.low, 1000 * mean.high]
                )
                np.testing.assert_allclose(lines(panel, f"{label}, units")[:, 1], 1000 * found.units[q])
        bars = {bar.get_label(): bar.patches[0] for bar in axes[2].containers}
        bar = bars[f"_{one.condition.name}, 10 %, SD"]
        assert bar.get_height() == pytest.approx(2000 * one.deviations.means[0].value)
        assert bar.get_y() == pytest.approx(1000 * (one.signed.means[0].value - one.deviations.means[0].value))


def test_caption_warns_that_intervals_over_movements_are_too_narrow() -> None:
    picture = delay.picture(made_study(random_blocks(), 'summaries.intervals="movements"'))
    assert "too narrow" in picture.caption
    assert "n = 54 movements" in picture.caption


def test_conditions_differ_in_marker_shape_or_fill(unusual: StudyData) -> None:
    axes = titled(dyads.picture(unusual), "completion time")
    looks = {
        line.get_label(): (line.get_marker(), line.get_markerfacecolor() == "white")
        for line in axes.lines
        if line.get_label() in [f"_{force}" for force in FORCES]
    }
    assert len(looks) == 5
    assert len(set(looks.values())) == 5


def test_caption_notes_that_areas_include_the_hold() -> None:
    caption = learning.picture(made_study(random_blocks(), 'movements.window="whole"')).caption
    assert "they exceed the completion time" in caption


def test_caption_calls_only_simulated_participants_simulated() -> None:
    made = made_study([Block("D01", "D01", "dyadic", "none", times(1, 2))])
    made.blocks["simulated"] = 0
    assert "imulated" not in learning.picture(made).caption
