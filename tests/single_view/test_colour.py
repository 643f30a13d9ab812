"""Colours of boxes: histograms, distances, the likelihood by person and place, and its modes."""

from __future__ import annotations

import logging
from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray
from numpy.testing import assert_allclose, assert_array_equal

from tests.single_view.test_scenes import SMALL, truth
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.parameters.groups.pseudo_particle import PseudoParticleParams
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.colour import peaks, templates
from tracker.single_view.colour.appearance import Appearance
from tracker.single_view.colour.templates import (
    Likeness,
    appearance_of,
    likelihood_map,
    read_templates,
)
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import BINS, ColourModel, ColourSpaceName, KernelName
from tracker.single_view.pseudo_particle.particles import ColourParticles

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


SIGMA = 0.25


def test_it_is_the_likelihood_of_the_boxes_one_by_one(heads: Sequence, reader: FrameReader) -> None:
    model = read_templates(heads, "hue_saturation", "epanechnikov", reader)
    sizes = BoxSizes.of(heads.cameras[0], heads.room, heads.target_half_extents)
    picture = reader.picture(0, 4)
    assert picture is not None
    values = likelihood_map(picture, model, sizes, SIGMA, columns=37)
    height, width = picture.shape[:2]
    assert values.shape == (round(37 * height / width), 37)
    rows, columns = values.shape
    bins = colour.bin_map(picture, "hue_saturation")
    y, x = np.indices(values.shape).reshape(2, -1)
    centres = np.column_stack([(x + 0.5) * width / columns, (y + 0.5) * height / rows]) - 0.5
    boxes, possible = sizes.typical(centres)
    assert 0 < possible.sum() < len(possible)
    for place, box, value in zip(centres, boxes, values.ravel(), strict=True):
        expected = -np.inf
        if np.isfinite(box).all():
            distance = model.distances(bins, np.array([[*place, *box]])).min()
            expected = float(-0.5 * (distance / SIGMA) ** 2)
        assert value == pytest.approx(expected)
    # a picture that is much wider than high has one row at least
    assert likelihood_map(picture[:1], model, sizes, SIGMA, columns=20).shape == (1, 20)


def likeness_of(sequence: Sequence) -> Likeness | None:
    with FrameReader(sequence) as reader:
        return Likeness.of(sequence, reader)


def test_whom_a_box_looks_like_follows_from_its_distances_to_everybody(
    heads: Sequence, reader: FrameReader
) -> None:
    picture, likeness = reader.picture(0, 3), Likeness.of(heads, reader)
    assert likeness is not None
    assert picture is not None
    height, width = picture.shape[:2]
    own = truth(heads, 3)
    corners = np.array([[0.0, 0.0, 5.0, 5.0], [width - 1.0, height - 1.0, 3.0, 9.0]])
    beyond = np.array([[-90.0, 20.0, 5.0, 5.0], [width + 60.0, height + 60.0, 9.0, 9.0],
                       [20.0, -90.0, 5.0, 5.0]])  # fmt: skip
    every = np.concatenate([own, corners, beyond])
    told = likeness.of_boxes(picture, every)
    p = ColourPhdParams()
    model = read_templates(heads, p.colour_space, p.histogram_kernel, reader)
    bins = colour.bin_map(picture, p.colour_space)
    powers = np.exp(-0.5 * (model.distances(bins, every) / p.likelihood_sigma) ** 2)
    assert_allclose(told, powers / powers.sum(axis=1, keepdims=True))
    assert_allclose(told[4:], 0.5)
    assert told[0, 0] > 0.9
    assert told[1, 1] > 0.9
    assert_allclose(likeness.of_boxes(picture, every[1:2]), told[1:2])  # whatever else asks
    assert likeness.of_boxes(picture, every[:0]).shape == (0, 2)
    looks = appearance_of(picture, every)
    roots = np.sqrt(colour.histograms(bins, every, p.colour_space, p.histogram_kernel))
    assert_allclose(looks, roots, atol=1e-3)
    assert_allclose(np.linalg.norm(looks[:4].astype(float), axis=1), 1.0, atol=1e-2)
    assert not looks[4:].any()
    # of a large box some pixels alone count, from its own edge on, wherever the picture is cut
    large = np.array([[48.0, 36.0, 30.0, 30.0]])
    roots = np.sqrt(colour.histograms(bins, large, p.colour_space, p.histogram_kernel))
    assert_allclose(appearance_of(picture, large), roots, atol=1e-3)


def test_there_is_nobody_to_tell_apart(heads: Sequence) -> None:
    alone = replace(heads, templates=heads.templates[:1])
    assert likeness_of(alone) is None
    assert likeness_of(replace(heads, templates=())) is None


def test_a_template_that_cannot_be_read_is_told_and_hinders_nobody(
    heads: Sequence, caplog: pytest.LogCaptureFixture
) -> None:
    away = replace(heads.templates[1], box=np.array([9000.0, 9000.0, 5.0, 5.0]))
    broken = replace(heads, templates=(heads.templates[0], away))
    with caplog.at_level(logging.WARNING):
        assert likeness_of(broken) is None
    assert 'template "green"' in caplog.text


def test_the_templates_of_a_run_are_read_once(
    heads: Sequence, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = []
    histograms = templates.colour.histograms
    monkeypatch.setattr(
        templates.colour, "histograms", lambda *a: read.append(len(a[1])) or histograms(*a)
    )
    with FrameReader(heads) as reader:
        first = templates.read_templates(heads, "hue_saturation", "epanechnikov", reader)
        assert Likeness.of(heads, reader) is not None
        assert read == [1] * len(heads.templates)
        fewer = replace(heads, templates=heads.templates[:1])
        other = templates.read_templates(fewer, "hue_saturation", "epanechnikov", reader)
        assert len(other.roots) < len(first.roots)


FOREGROUND = ForegroundParams(
    minimum_area=int(SMALL["foreground.minimum_area"]), threshold=SMALL["foreground.threshold"]
)


def appearance(
    heads: Sequence, reader: FrameReader, jitter: float, foreground: ForegroundParams | None = None
) -> Appearance:
    return Appearance(
        heads, 0, reader, colour_space="rgb", histogram_kernel="flat", size_jitter=jitter,
        foreground=foreground,
    )  # fmt: skip


def test_boxes_are_drawn_all_over_the_picture_in_sizes_that_are_possible_there(
    heads: Sequence, reader: FrameReader
) -> None:
    one, rng = appearance(heads, reader, 0.0), np.random.default_rng(0)
    width, height = heads.cameras[0].image_size
    boxes = one.draw_anywhere(6000, rng)
    possible = one.sizes.contains(one.sizes.places()).mean()
    assert len(boxes) / 6000 == pytest.approx(possible, abs=0.05)
    assert one.sizes.contains(boxes[:, :2]).all()
    assert (boxes[:, 2:] >= one.sizes.smallest).all()
    assert (boxes[:, 2:] <= one.sizes.largest).all()
    assert (boxes[:, :2] >= -0.5).all()
    assert (boxes[:, :2] <= [width - 0.5, height - 0.5]).all()
    share = boxes[:, :2] - np.floor(boxes[:, :2])
    assert np.abs(share.mean(axis=0) - 0.5).max() < 0.03
    # a jitter multiplies both sizes by one number
    again = appearance(heads, reader, 0.3).draw_anywhere(6000, np.random.default_rng(0))
    factors = np.log(again[:, 2:] / boxes[:, 2:])
    assert_allclose(factors[:, 0], factors[:, 1])
    assert factors[:, 0].std() == pytest.approx(0.3, rel=0.05)
    assert factors[:, 0].mean() == pytest.approx(0.0, abs=0.02)
    assert one.draw_anywhere(0, rng).shape == (0, 4)


def test_boxes_on_foreground_are_centred_on_its_pixels(
    heads: Sequence, reader: FrameReader
) -> None:
    one, rng = appearance(heads, reader, 0.0, FOREGROUND), np.random.default_rng(0)
    picture = reader.picture(0, 3)
    assert picture is not None
    _, scene = one.prepare(one.start(), picture)
    assert scene.mask is not None
    boxes = one.draw_on_foreground(500, scene, rng)
    columns, rows = np.floor(boxes[:, :2] + 0.5).astype(int).T
    assert scene.mask[rows, columns].all()
    assert len(np.unique(columns + 1000 * rows)) > 0.4 * scene.mask.sum()
    assert scene.foreground_share == pytest.approx(scene.mask.mean())
    assert len(one.draw_on_foreground(0, scene, rng)) == 0
    blind = appearance(heads, reader, 0.0)
    _, bare = blind.prepare(blind.start(), picture)
    assert bare.mask is None
    assert bare.foreground_share == 0.0
    assert len(blind.draw_on_foreground(9, bare, rng)) == 0
    factors, shares = blind.shape_scores(bare, boxes, inside_weight=1.0, around_weight=1.0)
    assert_array_equal(factors, np.zeros(len(boxes)))
    assert_array_equal(shares, np.ones(len(boxes)))


def test_a_centre_in_the_outer_pixels_is_in_the_picture_and_sizes_are_cut(
    heads: Sequence, reader: FrameReader
) -> None:
    one = appearance(heads, reader, 0.0)
    width, height = heads.cameras[0].image_size
    small, large = one.sizes.smallest, one.sizes.largest
    right, low = width - 1.0, height - 1.0
    inside = [[0.0, 0.0], [right, low], [0.0, low], [5.0, 5.0]]
    outside = [[-1e-9, 0.0], [0.0, -1e-9], [np.nextafter(right, 1e9), 0.0],
               [0.0, np.nextafter(low, 1e9)]]  # fmt: skip
    sizes = np.tile([0.5 * small, 2.0 * large, small, large], (2, 1))
    found = one.within(np.column_stack([[*inside, *outside], sizes]))
    assert_array_equal(found[:, :2], inside)
    assert_array_equal(found[:, 2:], [small, large, small, large])


def test_particles_walk_in_half_sizes_and_grow_as_a_whole(
    heads: Sequence, reader: FrameReader
) -> None:
    p = PseudoParticleParams(birth="picture")
    colours = ColourPhdParams(
        motion_sigma=0.8, growth_sigma=0.1, foreground_weight=0.0, surroundings_weight=0.0,
        acceptance_foreground=0.0,
    )  # fmt: skip
    model = ColourParticles(heads, 0, p, colours, ForegroundParams(), reader)
    sizes = appearance(heads, reader, 0.0).sizes
    middle = np.sqrt(sizes.smallest * sizes.largest)
    before = np.tile([48.0, 36.0, *middle], (5000, 1))
    after = model.move(before, np.random.default_rng(1))
    root = np.sqrt(heads.step_time)
    assert len(after) == 5000
    assert_allclose((after - before)[:, :2].std(axis=0), 0.8 * root * middle, rtol=0.04)
    assert_allclose((after - before)[:, :2].mean(axis=0), 0.0, atol=0.05)
    growth = np.log(after[:, 2:] / before[:, 2:])
    assert np.median(np.abs(growth)) == pytest.approx(0.6745 * 0.1 * root, rel=0.1)
    assert_array_equal(before, np.tile([48.0, 36.0, *middle], (5000, 1)))


CENTRES = np.array([[60.0, 50.0, 10.0, 15.0], [110.0, 52.0, 12.0, 16.0], [62.0, 140.0, 8.0, 12.0]])


def boxes_around(centres: ndarray, counts: list[int], seed: int = 0) -> ndarray:
    """Boxes that scatter by a quarter of their half sizes."""
    rng = np.random.default_rng(seed)
    return np.concatenate(
        [
            centre + rng.normal(0.0, 0.25, (count, 4)) * centre[[2, 3, 2, 3]]
            for centre, count in zip(centres, counts, strict=True)
        ]
    )


def climb(boxes: ndarray, weights: ndarray, most: int = 20) -> tuple[ndarray, ndarray]:
    starts = peaks.heaviest_samples(boxes, weights, most, spread=True)
    return peaks.modes(boxes, weights, boxes[starts], bandwidth=0.6, merge_distance=1.0)


def test_the_modes_of_a_mixture_are_found_densest_first() -> None:
    boxes = boxes_around(CENTRES, [500, 300, 150])
    modes, densities = climb(boxes, np.ones(len(boxes)))
    assert len(modes) == 3
    assert np.all(np.diff(densities) < 0.0)
    assert np.abs((modes - CENTRES) / CENTRES[:, [2, 3, 2, 3]]).max() < 0.1


def test_weights_make_modes_as_numbers_of_samples_do() -> None:
    boxes = boxes_around(CENTRES[:2], [300, 300])
    weights = np.repeat([0.2, 1.0], 300)
    modes, _ = climb(boxes, weights)
    assert np.abs(modes[0, :2] - CENTRES[1, :2]).max() < 1.5


@given(st.floats(0.1, 20.0), st.floats(-300.0, 300.0), st.floats(-300.0, 300.0))
def test_modes_move_and_grow_with_the_samples(scale: float, x: float, y: float) -> None:
    boxes = boxes_around(CENTRES, [60, 40, 20])
    modes, densities = climb(boxes, np.ones(len(boxes)))
    moved, same = climb(boxes * scale + [x, y, 0.0, 0.0], np.ones(len(boxes)))
    np.testing.assert_allclose(moved, modes * scale + [x, y, 0.0, 0.0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(same, densities, rtol=1e-6)


def test_a_mode_is_where_the_weighted_mean_of_its_neighbours_is() -> None:
    boxes = boxes_around(CENTRES, [80, 50, 30], seed=4)
    weights = np.random.default_rng(5).uniform(0.1, 1.0, len(boxes))
    modes, densities = climb(boxes, weights)
    for mode, density in zip(modes, densities, strict=True):
        offsets = (boxes - mode) / (0.6 * mode[[2, 3, 2, 3]])
        kernel = weights * np.exp(-0.5 * (offsets**2).sum(axis=1))
        step = (kernel @ boxes / kernel.sum() - mode) / mode[[2, 3, 2, 3]]
        assert np.linalg.norm(step) < 2 * peaks.TOLERANCE
        assert density == pytest.approx(kernel.sum(), rel=0.03)


def test_spread_starts_reach_the_weak_person_beside_the_strong_one() -> None:
    boxes = boxes_around(CENTRES[:2], [300, 100])
    weights = np.repeat([1.0, 0.01], [300, 100])
    spread = peaks.heaviest_samples(boxes, weights, 20, spread=True)
    heaviest = peaks.heaviest_samples(boxes, weights, 20, spread=False)
    assert (spread >= 300).any()
    assert (heaviest < 300).all()
    assert len(heaviest) == 20


def test_an_empty_sample_has_no_modes() -> None:
    nothing = np.zeros((0, 4))
    assert len(peaks.heaviest_samples(nothing, np.zeros(0), 20, spread=True)) == 0
    for starts in (nothing, CENTRES):
        modes, densities = peaks.modes(
            nothing, np.zeros(0), starts, bandwidth=0.5, merge_distance=1.0
        )
        assert modes.shape == (0, 4)
        assert densities.shape == (0,)


def test_samples_without_weight_have_no_modes() -> None:
    boxes = boxes_around(CENTRES, [10, 10, 10])
    assert len(peaks.heaviest_samples(boxes, np.zeros(30), 20, spread=False)) == 0
    modes, _ = peaks.modes(boxes, np.zeros(30), CENTRES, bandwidth=0.5, merge_distance=1.0)
    assert len(modes) == 0
