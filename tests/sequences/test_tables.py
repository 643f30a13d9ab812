"""The tables of a sequence folder: which steps they know."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.synthetic import write_sequence
from tracker.sequences.errors import SequenceError
from tracker.sequences.reader import read_sequence
from tracker.sequences.tables import regular_gap, truth_of


def test_a_gap_between_frames_is_decided_at_a_thousand_to_one() -> None:
    even = 2 * np.arange(12)  # 2 ** 10 : 1
    assert regular_gap(even) == 2
    assert regular_gap(even[:11]) == 1
    assert regular_gap(even[:7], even[:7]) == 2  # of another camera: five frames more each
    assert regular_gap(even[:7], 3 * np.arange(50)) == 1
    assert regular_gap(np.append(even, 101)) == 1
    assert regular_gap(10 * np.arange(5)) == 10
    assert regular_gap(np.array([3, 90])) == 1
    assert regular_gap(2000 * np.arange(3)) == 2000


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
        assert own.embeddings.shape == (FRAMES, 6)
        expected = values / np.maximum(np.linalg.norm(values, axis=1, keepdims=True), 1e-9)
        np.testing.assert_allclose(own.embeddings, expected, atol=1e-3)
    key = read_sequence(folder).digest
    np.save(folder / "cam1.npy", np.concatenate([values, values[:1], values[:0]])[:, :5])
    np.save(folder / "cam2.npy", values[:, :5])
    assert read_sequence(folder).digest != key


def test_vectors_are_read_block_after_block(tmp_path: Path) -> None:
    """A file with more rows than are read at once: each block is divided by its own lengths, and
    what is wrong is counted from the first row of the file."""
    rows = 4096 + FRAMES
    values = np.random.default_rng(1).normal(size=(rows, 2)).astype(np.float32)
    folder = folder_with(tmp_path / "room", values)
    boxes = [f"{row * FRAMES // rows},10,20,30,40,0.9" for row in range(rows)]
    lines = ["frame,left,top,width,height,score", *boxes]
    (folder / "cam1.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    own = read_sequence(folder).views[0].detections
    assert own is not None
    expected = values / np.linalg.norm(values, axis=1, keepdims=True)
    np.testing.assert_allclose(own.embeddings, expected, atol=1e-3)
    values[-1, 1] = np.nan
    np.save(folder / "cam1.npy", values)
    with pytest.raises(SequenceError, match=r"in row 4103 \(counted from 0\)"):
        read_sequence(folder)


def test_rows_from_the_first_step_after_the_sequence_on_are_left_out(tmp_path: Path) -> None:
    path = tmp_path / "truth.csv"
    path.write_text("frame,id,x,y,z\n" + "".join(f"{k},1,0,0,1\n" for k in range(4)))
    for frames, said in ((4, []), (3, ["truth: 1 of 4 rows are left out: of steps after 2"])):
        notes: list[str] = []
        truth = truth_of(path, "truth", frames, notes)
        assert truth.frames.tolist() == list(range(frames))
        assert [note.split(",")[0] for note in notes] == said
