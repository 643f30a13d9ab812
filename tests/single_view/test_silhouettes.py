"""Targets in outlines: heads and bodies of calibrated cameras, and pieces put together."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy import ndarray

from tests.world import HEAD as HALF_EXTENTS
from tests.world import SMALL_CAMERAS as CAMERAS
from tests.world import SMALL_ROOM as ROOM
from tracker import single_view
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.groups.association_matrix import AssociationMatrixParams
from tracker.parameters.values import with_values
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.single_view.association_matrix import method as association
from tracker.single_view.association_matrix.method import join
from tracker.single_view.association_matrix.silhouettes import Fits, Silhouettes
from tracker.single_view.box_sizes import upright_boxes
from tracker.single_view.pictures.blobs import blobs

CAMERA = CAMERAS[0]
NUMBERS = AssociationMatrixParams(acceptance=-2.0, further_acceptance=-1.4, spare_acceptance=-0.7)


@pytest.fixture(scope="module")
def silhouettes() -> Silhouettes:
    return Silhouettes(CAMERA, ROOM, HALF_EXTENTS)


def standing(*places: tuple[float, float, float]) -> tuple[ndarray, ndarray]:
    """A mask of people whose heads are at these places, shoulders and legs below them; the heads'
    boxes."""
    boxes, _ = upright_boxes(CAMERA, np.array(places), HALF_EXTENTS)
    width, height = CAMERA.image_size
    mask = np.zeros((height, width), np.uint8)
    for x, y, half_x, half_y in boxes:
        cv2.ellipse(mask, (round(x), round(y)), (round(half_x), round(half_y)), 0, 0, 360, 1, -1)
        shoulders = (round(x), round(y + 3.2 * half_y))
        axes = (round(2.4 * half_x), round(2.2 * half_y))
        cv2.ellipse(mask, shoulders, axes, 0, 0, 360, 1, -1)
        cv2.rectangle(mask, (round(x - half_x), shoulders[1]), (round(x + half_x), height), 1, -1)
    return mask, boxes


def found(silhouettes: Silhouettes, mask: ndarray, wanted: int) -> Fits:
    pieces = blobs(mask, 20)
    return silhouettes.fit(mask, pieces, np.full(pieces.size, wanted), NUMBERS)


def test_a_head_is_found_on_top_of_its_body(silhouettes: Silhouettes) -> None:
    mask, heads = standing((0.1, 0.0, 1.0))
    fits = found(silhouettes, mask, 1)
    assert len(fits.boxes) == 1
    off = (fits.boxes[0] - heads[0]) / heads[0, [2, 3, 2, 3]]
    assert np.abs(off).max() < 0.4
    assert fits.scores[0] > -0.7


def test_two_heads_in_one_outline_are_found_apart(silhouettes: Silhouettes) -> None:
    middle, side = np.array([0.0, 0.0, 1.0]), 0.2 * CAMERA.rotation[0]
    mask, heads = standing(tuple(middle - side), tuple(middle + side))
    assert blobs(mask, 20).size == 1
    fits = found(silhouettes, mask, 2)
    assert len(fits.boxes) == 2
    order, heads = fits.boxes[np.argsort(fits.boxes[:, 0])], heads[np.argsort(heads[:, 0])]
    assert np.abs((order - heads)[:, :2] / heads[:, 2:]).max() < 0.6
    np.testing.assert_array_equal(fits.owners, [0, 0])
    assert fits.scores[0] >= fits.scores[1]


def test_boxes_keep_apart_and_no_more_are_taken_than_wanted_or_very_good(
    silhouettes: Silhouettes,
) -> None:
    mask, _ = standing((-0.5, 0.2, 1.0), (0.0, 0.1, 1.05), (0.6, -0.2, 0.95))
    for wanted in range(5):
        fits = found(silhouettes, mask, wanted)
        for owner in range(blobs(mask, 20).size):
            mine = fits.owners == owner
            assert np.all(fits.scores[mine][wanted:] >= -0.7)
            boxes = fits.boxes[mine]
            apart = (boxes[:, None, :2] - boxes[None, :, :2]) / boxes[None, :, 2:]
            np.fill_diagonal(distance := (apart**2).sum(axis=2), np.inf)
            assert np.all(np.maximum(distance, distance.T) >= 1.0 - 1e-9)


@pytest.mark.parametrize("kind", ["nothing", "everything", "a pixel", "a line"])
def test_what_is_no_person_gives_no_error(silhouettes: Silhouettes, kind: str) -> None:
    width, height = CAMERA.image_size
    mask = np.zeros((height, width), np.uint8)
    if kind == "everything":
        mask[:] = 1
    elif kind == "a pixel":
        mask[height // 2, width // 2] = 1
    elif kind == "a line":
        mask[height // 2] = 1
    pieces = blobs(mask, 1)
    fits = silhouettes.fit(mask, pieces, np.ones(pieces.size), NUMBERS)
    assert len(fits.boxes) == len(fits.scores) == len(fits.owners)
    assert len(fits.boxes) <= 1
    assert len(silhouettes.half_heights(pieces.boxes[:, :2])) == pieces.size


def stacked(gap: int, shift: int = 0) -> ndarray:
    mask = np.zeros((80, 60), np.uint8)
    mask[5:20, 20:30] = 1
    mask[20 + gap : 50 + gap, 20 + shift : 30 + shift] = 1
    return mask


def test_a_head_and_its_body_become_one() -> None:
    pieces = blobs(stacked(4), 1)
    joined = join(pieces, np.full(2, 5.0))
    assert joined.size == 1
    np.testing.assert_allclose(joined.boxes, [[24.5, 29.0, 5.0, 24.5]])
    assert joined.areas.tolist() == [450]
    np.testing.assert_array_equal(joined.owners >= 0, stacked(4) > 0)
    assert join(pieces, np.full(2, 3.0)) is pieces


@pytest.mark.parametrize(("shift", "count"), [(0, 1), (4, 1), (7, 2), (15, 2)])
def test_only_what_lies_above_each_other_is_joined(shift: int, count: int) -> None:
    assert join(blobs(stacked(4, shift), 1), np.full(2, 5.0)).size == count


@given(st.integers(0, 300), st.floats(0.0, 12.0))
def test_joining_loses_no_pixel_and_keeps_the_order(seed: int, gap: float) -> None:
    rng = np.random.default_rng(seed)
    mask = (cv2.GaussianBlur(rng.random((50, 60)), (0, 0), 1.5) > 0.55).astype(np.uint8)
    pieces = blobs(mask, 1)
    joined = join(pieces, np.full(pieces.size, gap))
    np.testing.assert_array_equal(joined.owners >= 0, pieces.owners >= 0)
    assert joined.areas.sum() == pieces.areas.sum()
    assert joined.size <= pieces.size
    tops = joined.boxes[:, 1] - joined.boxes[:, 3]
    assert np.all(np.diff(tops) >= 0.0)
    for piece in range(joined.size):
        rows, columns = np.nonzero(joined.owners == piece)
        assert len(rows) == joined.areas[piece]
        edges = [columns.min() - 0.5, rows.min() - 0.5, columns.max() + 0.5, rows.max() + 0.5]
        x, y, half_x, half_y = joined.boxes[piece]
        np.testing.assert_allclose(edges, [x - half_x, y - half_y, x + half_x, y + half_y])


def test_few_pieces_are_joined_to_nothing() -> None:
    empty = blobs(np.zeros((10, 10), np.uint8), 1)
    assert join(empty, np.zeros(0)) is empty


@pytest.mark.parametrize(("gap", "count"), [(0.0, 2), (1.0, 1)])
def test_pieces_are_joined_where_a_gap_is_said(
    gap: float, count: int, heads: Sequence, reader: FrameReader, monkeypatch: pytest.MonkeyPatch
) -> None:
    mask = np.zeros((72, 96), np.uint8)
    mask[20:30, 40:50] = mask[33:50, 40:50] = 1
    monkeypatch.setattr(association, "blobs", lambda *_: blobs(mask, 1))
    values = {"association_matrix.join_gap": gap, "association_matrix.output": "objects"}
    method = single_view.create(
        "association_matrix", heads, 0, with_values(RunParameters(), values), reader
    )
    _, result = method.step(method.start(), 4, reader.picture(0, 4), np.random.default_rng(0))
    assert len(result.measurements) == count
