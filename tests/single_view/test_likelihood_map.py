"""The likelihood map: largest where the templates' people are, nothing where nobody can be."""

from __future__ import annotations

import numpy as np
import pytest

from tests.engine.painted import GREEN, RED, painted_sequence, true_boxes
from tracker.pictures import colour
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.box_sizes import BoxSizes
from tracker.single_view.colour.likelihood_map import likelihood_map
from tracker.single_view.colour.templates import read_templates

SIGMA = 0.25


@pytest.fixture(scope="module")
def painted(tmp_path_factory: pytest.TempPathFactory) -> Sequence:
    steps = np.linspace(0.0, 1.0, 5)[:, None]
    paths = [
        np.array([-0.8, 0.3, 0.9]) + steps * [0.3, 0.0, 0.0],
        np.array([0.7, -0.2, 0.9]) - steps * [0.2, 0.0, 0.0],
    ]
    return painted_sequence(tmp_path_factory.mktemp("painted"), paths, [RED, GREEN])


def test_it_is_the_likelihood_of_the_boxes_one_by_one_and_peaks_on_the_people(
    painted: Sequence,
) -> None:
    reader = FrameReader(painted)
    model = read_templates(painted, "hue_saturation", "epanechnikov", reader)
    sizes = BoxSizes.of(painted.cameras[0], painted.room, painted.target_half_extents)
    picture = reader.picture(0, 4)
    reader.close()
    assert picture is not None
    values = likelihood_map(picture, model, sizes, SIGMA, columns=90)
    height, width = picture.shape[:2]
    assert values.shape == (round(90 * height / width), 90)
    assert (values <= 0.0).all()

    rows, columns = values.shape
    bins = colour.bin_map(picture, "hue_saturation")
    for row, column in np.ndindex(*values.shape):
        if (row + 3 * column) % 41:
            continue
        centre = [(column + 0.5) * width / columns - 0.5, (row + 0.5) * height / rows - 0.5]
        box, possible = sizes.typical(np.array([centre]))
        expected = -np.inf
        if possible[0]:
            distance = model.distances(bins, np.array([[*centre, *box[0]]])).min()
            expected = float(-0.5 * (distance / SIGMA) ** 2)
        assert values[row, column] == pytest.approx(expected)

    assert np.isneginf(values).any()
    on_people = np.zeros_like(values, dtype=bool)
    for x, y, half_x, half_y in true_boxes(painted, 4):
        left, right = (np.array([x - half_x, x + half_x]) / width * columns).astype(int)
        top, bottom = (np.array([y - half_y, y + half_y]) / height * rows).astype(int)
        part = values[top : bottom + 1, left : right + 1]
        assert part.max() > -0.7
        on_people[top - 1 : bottom + 2, left - 1 : right + 2] = True
    assert values[on_people].max() > values[~on_people].max() + 0.7
