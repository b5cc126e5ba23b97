"""The colours by role: legible (WCAG 2.2, level AA), and distinguishable with any colour vision."""

from itertools import combinations

import numpy as np
import pytest

from netboard.base.looks import DARK, LIGHT, THEMES, ColourTheme, contrast, letters

TEXT, MARK = 4.5, 3.0
"""Least contrast of text, and of marks and frames [1]."""

SURFACES = ("background", "panel", "raised")
ON_SURFACES = ("text", "detail", "quiet")
STATES = ("good", "watch", "bad")
COLOURED = (*STATES, "link")
FILLS = ("selected", "stop", "pilot", "good", "watch", "bad")
PALE = ("cool", "warm", "notice")

# Machado, Oliveira and Fernandes (2009), severity 1, for linear RGB.
DEFICIENCIES = {
    "protanopia": ((0.152286, 1.052583, -0.204868), (0.114503, 0.786281, 0.099216), (-0.003882, -0.048116, 1.051998)),
    "deuteranopia": ((0.367322, 0.860646, -0.227968), (0.280085, 0.672501, 0.047413), (-0.011820, 0.042940, 0.968881)),
    "tritanopia": ((1.255528, -0.076749, -0.178779), (-0.078411, 0.930809, 0.147602), (0.004733, 0.691367, 0.303900)),
}
SEEN_APART = 15.0
"""Least distance in CIELAB of two lines of a plot; 2.3 is just noticeable [1]."""


def fill_of(theme: ColourTheme, name: str) -> str:
    return getattr(theme, f"{name}_fill" if name in STATES else name)


def lab(colour: str, deficiency: tuple) -> np.ndarray:
    rgb = np.array([int(colour[k : k + 2], 16) / 255 for k in (1, 3, 5)])
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(np.array(deficiency) @ linear, 0.0, 1.0)
    xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]]) @ seen
    f = np.cbrt(xyz / np.array([0.9505, 1.0, 1.089]))
    return np.array([116 * f[1] - 16, 500 * (f[0] - f[1]), 200 * (f[1] - f[2])])


@pytest.mark.parametrize("theme", THEMES.values(), ids=THEMES)
class TestLegible:
    @pytest.mark.parametrize("surface", SURFACES)
    @pytest.mark.parametrize("text", ON_SURFACES)
    def test_text(self, theme, surface, text):
        assert contrast(getattr(theme, text), getattr(theme, surface)) >= TEXT

    @pytest.mark.parametrize("surface", ["background", "panel"])
    @pytest.mark.parametrize("state", COLOURED)
    def test_a_coloured_text(self, theme, surface, state):
        assert contrast(getattr(theme, state), getattr(theme, surface)) >= TEXT

    @pytest.mark.parametrize("fill", FILLS)
    def test_text_on_a_fill(self, theme, fill):
        assert contrast(getattr(theme, f"on_{fill}"), fill_of(theme, fill)) >= TEXT

    @pytest.mark.parametrize("pale", PALE)
    def test_text_on_a_pale_fill(self, theme, pale):
        assert min(contrast(getattr(theme, text), getattr(theme, pale)) for text in ("text", "detail")) >= TEXT

    @pytest.mark.parametrize("frame", ["frame", "focus"])
    @pytest.mark.parametrize("surface", SURFACES)
    def test_frames_of_what_can_be_used(self, theme, frame, surface):
        assert contrast(getattr(theme, frame), getattr(theme, surface)) >= MARK

    def test_lines_of_plots(self, theme):
        assert min(contrast(line, theme.background) for line in theme.series) >= MARK

    @pytest.mark.parametrize("deficiency", DEFICIENCIES)
    def test_lines_of_plots_are_seen_apart(self, theme, deficiency):
        seen = [lab(line, DEFICIENCIES[deficiency]) for line in theme.series]
        apart = [float(np.linalg.norm(one - other)) for one, other in combinations(seen, 2)]
        assert min(apart) >= SEEN_APART


def test_a_contrast_that_is_known():
    assert contrast("#000000", "#FFFFFF") == pytest.approx(21.0)
    assert contrast("#777777", "#FFFFFF") == pytest.approx(4.48, abs=0.005)


def test_letters_grow_with_the_window():
    assert [letters(height) for height in (400, 768, 1080, 2160, 9000)] == [13, 14, 20, 40, 44]


def test_themes_differ_in_their_surfaces():
    assert contrast(DARK.background, LIGHT.background) >= 15.0
