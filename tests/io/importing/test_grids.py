"""A grid whose cells are numbered follows from where the annotated boxes stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy import ndarray

from tests.io.read.rig import cameras
from tracker.io.importing.finding.truths import feet_on_floor, infer_grid
from tracker.io.read.pieces import Grid, TruthPiece


def _walks(rng: np.random.Generator, size: tuple[float, float]) -> ndarray:
    """Places of 400 rows, metres."""
    return rng.uniform([0.0, 0.0], size, (400, 2))


@settings(deadline=None, max_examples=6)
@given(
    st.integers(100, 1500),
    st.sampled_from([0.01, 0.025, 0.05, 0.1]),
    st.booleans(),
    st.sampled_from([(1, 1), (1, -1), (-1, 1), (-1, -1)]),
    st.integers(0, 2**32 - 1),
)
def test_columns_cell_and_origin(
    columns: int, cell: float, exchanged: bool, signs: tuple[int, int], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    steps = (_walks(rng, (1.0, 1.0)) * [columns, min(columns, 600)]).astype(int)
    cells = steps[:, 0] + columns * steps[:, 1]
    origin = cell * rng.integers(-300, 300, 2)
    places = cell * steps * signs
    places = (places[:, ::-1] if exchanged else places) + origin
    found = infer_grid(cells, places + rng.normal(0.0, min(0.03, 0.3 * cell), places.shape))
    assert found is not None
    np.testing.assert_allclose(found[0], places, atol=1.01 * cell)
    assert f"{columns} columns of {100.0 * cell:.3g} cm" in found[1]


def test_places_that_are_of_no_grid_have_none() -> None:
    rng = np.random.default_rng(3)
    cells = rng.integers(0, 480 * 1440, 400)
    assert infer_grid(cells, _walks(rng, (12.0, 36.0))) is None
    assert infer_grid(cells[:20], _walks(rng, (12.0, 36.0))[:20]) is None
    assert infer_grid(cells, np.full((400, 2), np.nan)) is None


@pytest.mark.parametrize("floor", [0.0, 0.2])
def test_feet_are_on_the_floor_where_a_camera_sees_them(floor: float) -> None:
    places = np.array([[0.5, 0.2], [-1.0, 1.0], [0.0, 0.0]])
    points = np.column_stack([places, np.full(3, floor)])
    feet = {str(n): camera.project(points)[0] for n, camera in enumerate(cameras())}
    for pixels in feet.values():
        pixels[2] = np.nan
    feet["0"][0] += [0.0, 300.0]  # cut by somebody before the feet
    truth = TruthPiece(
        source=Path(),
        format="", frames=np.arange(3), ids=np.arange(3), positions=np.zeros((3, 3)), feet=feet,
    )  # fmt: skip
    found = feet_on_floor(truth, ["0", "1", "2", None], cameras(), floor)
    np.testing.assert_allclose(found[:2], places[:2], atol=1e-3)
    assert np.isnan(found[2]).all()
    assert np.isnan(feet_on_floor(truth, [None] * 4, cameras(), floor)).all()


def test_a_grid_counts_row_by_row() -> None:
    grid = Grid("a square", 10, 0.5, (1.0, -2.0))
    np.testing.assert_allclose(grid.places(np.array([0, 9, 10])), [[1, -2], [5.5, -2], [1, -1.5]])
