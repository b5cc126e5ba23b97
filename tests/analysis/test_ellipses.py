"""Ellipses against scikit-learn's components, the eigenvectors of the covariance, and the normal distribution."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.stats import norm
from sklearn.covariance import EmpiricalCovariance
from sklearn.decomposition import PCA
from sklearn.preprocessing import StandardScaler

from netboard.analysis.measures.ellipses import convergence, ellipse, groups_of

EXTENTS = ("middle_90", "twice_p90", "p10_to_p90", "nine_tenths")
CENTRE, ROTATION, SPREAD = np.array([0.2, 0.15]), 0.5, np.array([0.06, 0.01])

clouds = arrays(np.float64, st.tuples(st.integers(5, 40), st.just(2)), elements=st.floats(-1, 1, width=32))


def turned(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def cloud(count: int, seed: int = 1) -> np.ndarray:
    """Normally distributed points, elongated along an axis at 0.5 rad."""
    return CENTRE + (np.random.default_rng(seed).normal(size=(count, 2)) * SPREAD) @ turned(ROTATION)


def well_shaped(points: np.ndarray) -> bool:
    """Whether the order and the signs of the components are unambiguous."""
    values, vectors = np.linalg.eigh(np.cov(points, rowvar=False))
    return bool(values[1] > 1e-6 and values[1] > 1.01 * values[0] and abs(vectors[0, 1]) > 1e-3)


@pytest.mark.evidence("truth", ellipse)
def test_ellipse_of_normal_points_has_known_extents() -> None:
    """Known standard deviations give known quantiles, and with them every extent except that of the range."""
    points = cloud(200_000)
    found = ellipse(points)
    np.testing.assert_allclose(found.centre, CENTRE, atol=1e-3)
    assert found.rotation == pytest.approx(ROTATION, abs=1e-3)
    for extent, quantile in (("middle_90", 0.95), ("twice_p90", 0.95), ("p10_to_p90", 0.9)):
        sized = ellipse(points, extent=extent)
        np.testing.assert_allclose([sized.width, sized.height], 2 * norm.ppf(quantile) * SPREAD, rtol=0.01)
    assert found.area == pytest.approx(np.pi * norm.ppf(0.95) ** 2 * SPREAD.prod(), rel=0.02)


@pytest.mark.slow
@pytest.mark.evidence("independent", ellipse, by="scikit-learn")
@given(clouds)
def test_components_equal_pca_of_scikit_learn(points: np.ndarray) -> None:
    assume(well_shaped(points))
    pca = PCA(2).fit(points)
    found = ellipse(points)
    np.testing.assert_allclose(found.centre, pca.mean_, atol=1e-9)
    np.testing.assert_allclose(np.abs(np.sum(found.components * pca.components_, axis=1)), 1, atol=1e-6)
    scores = pca.transform(points)
    for extent, of in {
        "middle_90": lambda s: np.quantile(s, 0.95) - np.quantile(s, 0.05),
        "twice_p90": lambda s: 2 * np.quantile(np.abs(s), 0.9),
        "p10_to_p90": lambda s: np.quantile(s, 0.9) - np.quantile(s, 0.1),
        "nine_tenths": lambda s: 0.9 * np.ptp(s),
    }.items():
        sized = ellipse(points, extent=extent)
        np.testing.assert_allclose([sized.width, sized.height], [of(s) for s in scores.T], atol=1e-5)


@pytest.mark.evidence("independent", ellipse, by="numpy")
@given(clouds)
def test_components_are_the_eigenvectors_of_the_covariance(points: np.ndarray) -> None:
    assume(well_shaped(points))
    vectors = np.linalg.eigh(np.cov(points, rowvar=False))[1][:, ::-1].T
    np.testing.assert_allclose(np.abs(np.sum(ellipse(points).components * vectors, axis=1)), 1, atol=1e-6)


@given(clouds)
def test_components_are_a_proper_rotation(points: np.ndarray) -> None:
    found = ellipse(points)
    np.testing.assert_allclose(found.components @ found.components.T, np.eye(2), atol=1e-9)
    assert np.linalg.det(found.components) == pytest.approx(1)
    assert abs(found.rotation) <= np.pi / 2 + 1e-12
    np.testing.assert_allclose(found.components, turned(found.rotation), atol=1e-9)


@pytest.mark.evidence("independent", ellipse, by="scikit-learn")
def test_standardised_ellipse_equals_that_of_scaled_points() -> None:
    points = cloud(300)
    scaled = StandardScaler().fit_transform(points) * np.sqrt(299 / 300)
    found, expected = ellipse(points, scaling="standardised"), ellipse(scaled)
    np.testing.assert_allclose(found.components, expected.components)
    np.testing.assert_allclose([found.width, found.height], [expected.width, expected.height])
    np.testing.assert_allclose(found.scale, points.std(axis=0, ddof=1))
    assert found.area == pytest.approx(expected.area * found.scale.prod())
    in_mm = ellipse(points * [1000, 1], scaling="standardised")
    np.testing.assert_allclose(in_mm.components, found.components)
    same = ellipse(np.array([[1.0, 0], [1, 1], [1, 3]]), scaling="standardised")
    assert np.isfinite(same.width)


@pytest.mark.evidence("truth", ellipse)
@pytest.mark.parametrize("scaling", ["si", "standardised"])
def test_outline_encloses_the_expected_share_of_points(scaling: str) -> None:
    points = cloud(20_000)
    found = ellipse(points, scaling=scaling)
    outline = found.outline(401)
    np.testing.assert_allclose(outline[0], outline[-1])
    np.testing.assert_allclose(outline[:-1].mean(axis=0), found.centre, atol=1e-9)
    x, y = outline.T
    assert np.abs(np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])) / 2 == pytest.approx(found.area, rel=1e-3)
    inside = EmpiricalCovariance().fit(points).mahalanobis(points) <= norm.ppf(0.95) ** 2
    assert inside.mean() == pytest.approx(1 - np.exp(-(norm.ppf(0.95) ** 2) / 2), abs=0.01)


@pytest.mark.slow
@pytest.mark.evidence("properties", ellipse, of=("unit", "constant"))
@given(clouds, st.sampled_from(EXTENTS), arrays(np.float64, 2, elements=st.floats(-5, 5)), st.floats(0.1, 10))
def test_ellipse_scales_with_its_points(points: np.ndarray, extent: str, place: np.ndarray, factor: float) -> None:
    assume(well_shaped(points))
    found, moved = ellipse(points, extent=extent), ellipse(factor * points + place, extent=extent)
    np.testing.assert_allclose(moved.centre, factor * found.centre + place, atol=1e-9)
    np.testing.assert_allclose(moved.components, found.components, atol=1e-4)
    np.testing.assert_allclose([moved.width, moved.height], [factor * found.width, factor * found.height], atol=1e-4)


@pytest.mark.evidence("disturbance", ellipse, of="holes")
@pytest.mark.evidence("properties", ellipse, of="order")
@given(clouds, st.sampled_from(["middle_90", "twice_p90", "p10_to_p90", "nine_tenths"]), st.randoms())
def test_ellipse_ignores_order_and_missing_points(points: np.ndarray, extent: str, chance: object) -> None:
    assume(well_shaped(points))
    order = list(range(len(points)))
    chance.shuffle(order)  # type: ignore[attr-defined]
    holed = np.concatenate([points[order], [[np.nan, 0.1], [0.1, np.nan]]])
    found, other = ellipse(points, extent=extent), ellipse(holed, extent=extent)
    assert other.count == len(points)
    np.testing.assert_allclose([other.width, other.height], [found.width, found.height], atol=1e-6)


def test_ellipse_of_two_points_is_nan() -> None:
    found = ellipse(np.array([[0.0, 1], [1, 2], [np.nan, 3]]))
    assert found.count == 2
    assert np.isnan([found.width, found.height, found.area, found.rotation, *found.centre]).all()


@pytest.mark.evidence("truth", groups_of)
def test_trials_are_grouped_by_thirty() -> None:
    np.testing.assert_array_equal(groups_of(np.array([1, 30, 31, 60, 61, 180])), [0, 0, 1, 1, 2, 5])


@pytest.mark.evidence("independent", convergence, by="scikit-learn")
def test_variance_and_area_shrink_over_groups() -> None:
    """Six groups of 30; each has two thirds of the spread of the one before."""
    sizes = (2 / 3) ** np.repeat(np.arange(6), 30)
    points = CENTRE + (cloud(180, seed=4) - CENTRE) * sizes[:, None]
    groups = groups_of(1 + np.arange(180))
    found = convergence(points, groups)
    np.testing.assert_array_equal(found.groups, np.arange(6))
    for k in range(6):
        own = points[groups == k]
        np.testing.assert_allclose(found.variance[k], own.var(axis=0, ddof=1))
        covariance = EmpiricalCovariance().fit(own).covariance_ * 30 / 29
        np.testing.assert_allclose(found.generalised[k], np.linalg.det(covariance))
        assert found.areas[k] == ellipse(own).area
    assert (np.diff(found.areas) < 0).all()
    assert (np.diff(found.variance, axis=0) < 0).all()


@pytest.mark.evidence("disturbance", convergence, of="holes")
def test_group_with_too_few_trials_has_no_variance() -> None:
    found = convergence(np.array([[0.0, 1], [1, 2], [np.nan, 3], [0, 0], [1, 0], [0, 1]]), np.array([0, 0, 0, 1, 1, 1]))
    assert np.isnan([*found.variance[0], found.generalised[0], found.areas[0]]).all()
    assert np.isfinite([*found.variance[1], found.generalised[1], found.areas[1]]).all()
    assert len(convergence(np.zeros((0, 2)), np.zeros(0, np.int64)).ellipses) == 0
