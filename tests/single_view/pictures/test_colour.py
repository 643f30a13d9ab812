"""Histograms, the distance between them and the colour likelihood: laws and a plain reference."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import BINS, ColourModel, ColourSpaceName, KernelName

SPACES: tuple[ColourSpaceName, ...] = ("hue_saturation", "rgb", "hsi")
KERNELS: tuple[KernelName, ...] = ("epanechnikov", "flat")


def picture_of(seed: int, height: int = 40, width: int = 50) -> ndarray:
    """A picture of a few large and many small colours."""
    rng = np.random.default_rng(seed)
    picture = rng.integers(0, 256, (height, width, 3), dtype=np.uint8)
    picture[:, : width // 2] = cv2.blur(picture[:, : width // 2], (9, 9))
    return picture


def reference_histogram(bins: ndarray, box: ndarray, count: int, kernel: KernelName) -> ndarray:
    """The definition, pixel by pixel over the whole picture."""
    y, x = np.mgrid[: bins.shape[0], : bins.shape[1]]
    u, v = (x - box[0]) / box[2], (y - box[1]) / box[3]
    weights = (
        np.clip(1.0 - u**2 - v**2, 0.0, None) if kernel == "epanechnikov" else np.ones(u.shape)
    )
    weights = weights * ((np.abs(u) <= 1.0) & (np.abs(v) <= 1.0))
    histogram = np.bincount(bins.ravel(), weights.ravel(), minlength=count)
    return histogram / histogram.sum() if histogram.sum() > 0.0 else histogram


def bhattacharyya(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """sqrt(1 - Σ_u sqrt(p(u) q(u))) over the last axis."""
    return np.sqrt(np.clip(1.0 - np.sqrt(first * second).sum(axis=-1), 0.0, 1.0))


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("kernel", KERNELS)
def test_histograms_agree_with_their_definition(space: ColourSpaceName, kernel: KernelName) -> None:
    bins = colour.bin_map(picture_of(1), space)
    boxes = np.array([[20.0, 15.0, 6.0, 9.0], [2.3, 3.7, 5.5, 8.25], [48.6, 38.1, 11.0, 3.5]])
    found = colour.histograms(bins, boxes, space, kernel)
    for box, histogram in zip(boxes, found, strict=True):
        np.testing.assert_allclose(
            histogram, reference_histogram(bins, box, BINS[space], kernel), atol=1e-12
        )
    np.testing.assert_allclose(found.sum(axis=1), 1.0)


@pytest.mark.parametrize("space", SPACES)
@pytest.mark.parametrize("kernel", KERNELS)
def test_distances_agree_with_the_histograms(space: ColourSpaceName, kernel: KernelName) -> None:
    bins = colour.bin_map(picture_of(2), space)
    rng = np.random.default_rng(3)
    boxes = np.column_stack([rng.uniform(-5, 55, (40, 2)), rng.uniform(0.2, 20.0, (40, 2))])
    templates = colour.histograms(
        bins, np.array([[10.0, 20, 5, 8], [30, 20, 5, 8], [40, 10, 4, 4]]), space, kernel
    )
    model = ColourModel.of(templates, ["Ann", "Ben", "Ann"], space, kernel)
    assert model.names == ("Ann", "Ben")
    histograms = colour.histograms(bins, boxes, space, kernel)
    each = bhattacharyya(histograms[:, None], templates[None])
    expected = np.stack([np.minimum(each[:, 0], each[:, 2]), each[:, 1]], axis=1)
    np.testing.assert_allclose(model.distances(bins, boxes), expected, atol=1e-7)


def test_hues_count_only_where_there_is_colour() -> None:
    grey = np.full((4, 4, 3), 130, dtype=np.uint8)
    almost = grey + np.array([0, 0, 3], dtype=np.uint8)  # a trace of red
    red = np.zeros((4, 4, 3), dtype=np.uint8)
    red[..., 2] = 200
    bins = [colour.bin_map(picture, "hue_saturation")[0, 0] for picture in (grey, almost, red)]
    assert bins[0] == bins[1]
    assert bins[0] >= 256
    assert bins[2] < 256


@given(st.integers(0, 2**32 - 1), st.sampled_from(SPACES))
def test_every_pixel_has_a_bin(seed: int, space: ColourSpaceName) -> None:
    rng = np.random.default_rng(seed)
    bins = colour.bin_map(rng.integers(0, 256, (7, 5, 3), dtype=np.uint8), space)
    assert bins.shape == (7, 5)
    assert bins.max() < BINS[space]


def test_a_box_of_one_pixel_and_one_outside() -> None:
    bins = colour.bin_map(picture_of(4), "rgb")
    boxes = np.array([[12.0, 9.0, 0.01, 0.01], [500.0, 500.0, 5.0, 5.0]])
    histograms = colour.histograms(bins, boxes, "rgb", "epanechnikov")
    assert histograms[0, bins[9, 12]] == 1.0
    assert not histograms[1].any()
    model = ColourModel.of(histograms[:1], ["spot"], "rgb", "epanechnikov")
    np.testing.assert_allclose(model.distances(bins, boxes), [[0.0], [1.0]], atol=1e-7)


def test_no_boxes_give_no_distances() -> None:
    bins = colour.bin_map(picture_of(5), "rgb")
    model = ColourModel.of(np.full((1, 512), 1 / 512), ["all"], "rgb", "flat")
    assert model.distances(bins, np.zeros((0, 4))).shape == (0, 1)
    assert colour.histograms(bins, np.zeros((0, 4)), "rgb", "flat").shape == (0, 512)


def test_a_stride_over_large_boxes_keeps_the_histogram() -> None:
    rng = np.random.default_rng(6)
    palette = rng.integers(0, 256, (6, 3), dtype=np.uint8)
    small = palette[rng.integers(0, 6, (60, 60))]
    large = cv2.resize(small, None, fx=6, fy=6, interpolation=cv2.INTER_NEAREST)
    box = np.array([[30.0, 30.0, 15.0, 20.0]])
    pair = [
        colour.histograms(colour.bin_map(picture, "rgb"), boxes, "rgb", "epanechnikov")[0]
        for picture, boxes in ((small, box), (large, box * 6 + [2.5, 2.5, 0, 0]))
    ]
    assert bhattacharyya(pair[0], pair[1]) < 0.05


def test_a_model_says_what_is_wrong() -> None:
    with pytest.raises(ValueError, match="at least one template"):
        ColourModel.of(np.zeros((0, 512)), [], "rgb", "flat")
    with pytest.raises(ValueError, match=r"272 bins.*got \(1, 512\)"):
        ColourModel.of(np.zeros((1, 512)), ["Ann"], "hue_saturation", "flat")
    with pytest.raises(ValueError, match="expected one of hue_saturation, rgb, hsi, got 'hsv'"):
        colour.bin_map(picture_of(7), "hsv")  # type: ignore[arg-type]


def test_hue_saturation_bins_agree_with_numpy() -> None:
    hsv = cv2.cvtColor(picture_of(8), cv2.COLOR_BGR2HSV).astype(int)
    hue, saturation, value = hsv[..., 0], hsv[..., 1], hsv[..., 2]
    coloured = (saturation >= colour.LEAST_SATURATION) & (value >= colour.LEAST_VALUE)
    expected = np.where(coloured, hue * 16 // 180 * 16 + saturation // 16, 256 + value // 16)
    np.testing.assert_array_equal(colour.bin_map(picture_of(8), "hue_saturation"), expected)


@pytest.mark.parametrize(
    ("colour_bgr", "hue", "saturation", "intensity"),
    [
        ((0, 0, 250), 0, 3, 1),
        ((0, 250, 250), 2, 3, 2),
        ((0, 250, 0), 5, 3, 1),
        ((250, 250, 0), 8, 3, 2),
        ((250, 0, 0), 10, 3, 1),
        ((250, 0, 250), 13, 3, 2),
        ((100, 100, 220), 0, 1, 2),
        ((50, 50, 110), 0, 1, 1),  # half the light: the same hue and saturation
    ],
)
def test_hsi_bins_are_of_hue_saturation_and_intensity(
    colour_bgr: tuple[int, int, int], hue: int, saturation: int, intensity: int
) -> None:
    pixel = np.array([[colour_bgr]], dtype=np.uint8)
    assert colour.bin_map(pixel, "hsi")[0, 0] == hue * 16 + saturation * 4 + intensity


@given(st.integers(0, 255), st.integers(-6, 6), st.integers(-6, 6))
def test_what_is_grey_or_dark_has_no_hue_in_hsi(level: int, green: int, red: int) -> None:
    pixel = np.clip([[[level, level + green, level + red]]], 0, 255).astype(np.uint8)
    mean = np.mean((pixel >> 3) * 8.0 + 3.5)
    if level > 90 or level < 25:
        assert colour.bin_map(pixel, "hsi")[0, 0] == 256 + int(mean // 32)


def test_hsi_bins_are_the_formula_of_five_bits_a_channel() -> None:
    rng = np.random.default_rng(9)
    picture = rng.integers(0, 256, (60, 60, 3), dtype=np.uint8)
    picture[:20] = picture[:20, :, :1] + rng.integers(0, 30, (20, 60, 3))  # little colour
    blue, green, red = np.moveaxis((picture >> 3) * 8.0 + 3.5, 2, 0)
    # the same angle as that of the cosine, by its sine as well
    hue = np.arctan2(np.sqrt(3.0) * (green - blue), 2.0 * red - green - blue) % (2.0 * np.pi)
    intensity = (red + green + blue) / 3.0
    saturation = 1.0 - np.minimum(np.minimum(red, green), blue) / intensity
    cut = [np.minimum(hue / (2.0 * np.pi) * 16.0, 15), np.minimum(saturation * 4.0, 3),
           np.minimum(intensity / 64.0, 3)]  # fmt: skip
    coloured = (np.floor(cut) * np.array([16, 4, 1])[:, None, None]).sum(axis=0)
    has_hue = (saturation * 255.0 >= 40) & (intensity >= 40)
    expected = np.where(has_hue, coloured, 256 + intensity // 32)
    assert 0.1 < has_hue.mean() < 0.9
    # at a bin's edge rounding decides
    assert (colour.bin_map(picture, "hsi") == expected).mean() > 0.995
