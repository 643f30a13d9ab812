"""The likelihood map: of every place the likelihood of the box that a target would have there."""

from __future__ import annotations

import numpy as np
import pytest

from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.colour.templates import likelihood_map, read_templates
from tracker.single_view.pictures import colour

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
