"""Appearance vectors beside the table of boxes: read by its rows, refused with a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.synthetic import write_sequence
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import SequenceError

FRAMES = 8


def folder_with(folder: Path, first: ndarray, second: ndarray | None = None) -> Path:
    write_sequence(folder, frames=FRAMES, container=None, detections=True)
    path = folder / "sequence.toml"
    text = path.read_text(encoding="utf-8")
    for name, values in (("cam1", first), ("cam2", second)):
        if values is not None:
            np.save(folder / f"{name}.npy", values)
            line = f'detections = "{name}.csv"'
            text = text.replace(line, f'{line}\nappearance = "{name}.npy"')
    path.write_text(text, encoding="utf-8")
    return folder


def test_vectors_have_the_order_of_the_table_and_the_length_one(tmp_path: Path) -> None:
    values = np.random.default_rng(0).normal(size=(FRAMES, 6)).astype(np.float32)
    values[3] = 0.0
    folder = folder_with(tmp_path / "room", values, 1e300 * values.astype(float))
    lines = (folder / "cam1.csv").read_text(encoding="utf-8").splitlines()
    rows = [*lines[1:][::-1], "2,,,,,"]  # the last row first, and one that is no box
    (folder / "cam1.csv").write_text("\n".join([lines[0], *rows]) + "\n", encoding="utf-8")
    np.save(folder / "cam1.npy", np.concatenate([values[::-1], values[:1]]))
    for view in read_sequence(folder).views:
        own = view.detections
        assert own is not None
        assert own.looks.shape == (FRAMES, 6)
        expected = values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-9)
        np.testing.assert_allclose(own.looks, expected, atol=1e-3)
    key = read_sequence(folder).digest
    np.save(folder / "cam1.npy", np.concatenate([values, values[:1], values[:0]])[:, :5])
    np.save(folder / "cam2.npy", values[:, :5])
    assert read_sequence(folder).digest != key


@pytest.mark.parametrize(
    ("values", "problem"),
    [
        (np.zeros((FRAMES - 1, 4)), "expected a row for each of the 8 rows"),
        (np.zeros(FRAMES), "rows × length of a vector, found 8 of"),
        (np.zeros((FRAMES, 4), dtype=np.int64), "expected a table of floating-point numbers"),
        (np.zeros((FRAMES, 0)), "expected vectors of 1 to 4,096 numbers, found 0"),
        (np.array([["a"] * 3] * FRAMES, dtype=object), "NumPy's format .npy, found none"),
        (np.where(np.arange(FRAMES) == 5, np.nan, 1.0)[:, None], "found one that is none in row 5"),
        (np.full((FRAMES, 2), np.inf), "found one that is none in row 0"),
    ],
)
def test_what_is_no_such_file_gets_a_sentence(
    tmp_path: Path, values: ndarray, problem: str
) -> None:
    folder = folder_with(tmp_path / "room", values)
    with pytest.raises(SequenceError, match=r'camera "cam1".*appearance.*' + problem):
        read_sequence(folder)


def test_bytes_that_are_no_array_get_one_too(tmp_path: Path) -> None:
    folder = folder_with(tmp_path / "room", np.zeros((FRAMES, 4)))
    for content in (
        b"",
        b"\x93NUMPY\x01\x00",
        b"\x93NUMPY\x01\x00\x10\x00{'descr': __im}",
        b"x" * 99,
    ):
        (folder / "cam1.npy").write_bytes(content)
        with pytest.raises(SequenceError, match="found none; write it with"):
            read_sequence(folder)


def test_one_network_looks_into_all_cameras(tmp_path: Path) -> None:
    folder = folder_with(tmp_path / "room", np.ones((FRAMES, 4)), np.ones((FRAMES, 5)))
    with pytest.raises(SequenceError, match="vectors of 4 numbers as in camera"):
        read_sequence(folder)


def test_vectors_of_no_boxes_are_told(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "room", frames=FRAMES)
    path = folder / "sequence.toml"
    text = path.read_text(encoding="utf-8")
    path.write_text(
        text.replace('name = "cam1"\n', 'name = "cam1"\nappearance = "a.npy"\n'), encoding="utf-8"
    )
    with pytest.raises(SequenceError, match=r"appearance.*has no meaning without detections"):
        read_sequence(folder)
