"""What the program writes it reads back: three people, one of them with a gap, one who leaves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.engine import synthetic
from tests.io.read.rig import raw_cameras, read
from tracker.export.calibration import save_calibration
from tracker.export.exported_run import ExportedRun
from tracker.export.reading import read_tracks
from tracker.export.registry import FORMATS, save
from tracker.fusion.trajectories import Trajectories
from tracker.io.importing.gathering import gather
from tracker.io.read.pieces import DetectionPiece, TruthPiece
from tracker.parameters.catalogue import RunParameters
from tracker.sequences.sequence import GroundTruth

STEPS = 40
PRESENT = {1: [*range(STEPS)], 4: [*range(0, 12), *range(25, STEPS)], 11: [*range(3, 20)]}
"""The steps of each person."""

TO_WORLD = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
"""From a world with y up."""


def _tracks() -> Trajectories:
    rows = sorted((step, who) for who, steps in PRESENT.items() for step in steps)
    frames, ids = np.array(rows, dtype=np.int64).T
    cameras = len(SEQUENCE.views)
    time = frames / SEQUENCE.fps
    places = np.column_stack(
        [0.1 * ids - 0.5 + 0.2 * time, 0.3 * np.sin(ids + time), 0.85 + 0 * time]
    )
    return replace(
        Trajectories.empty(cameras),
        frames=frames,
        ids=ids,
        positions=places,
        existences=np.linspace(0.5, 1.0, len(ids)),
        sigmas=np.full((len(ids), 3), 0.05),
        covariances_xy=np.linspace(-0.002, 0.002, len(ids)),
        heights=np.linspace(1.5, 1.9, len(ids)),
        sigma_heights=np.linspace(0.01, 0.05, len(ids)),
        seen=np.ones((len(ids), cameras), dtype=bool),
        components=np.zeros(len(ids), dtype=np.int64),
    )


SEQUENCE = synthetic.sequence([], STEPS)
RUN = ExportedRun(SEQUENCE, _tracks(), RunParameters())
Rows = tuple[ndarray, ndarray, ndarray]
"""Frames from 0, ids, and places in metres."""


def _of_truth(path: Path) -> Rows:
    (truth,) = (piece for piece in read(path)[1] if isinstance(piece, TruthPiece))
    assert truth.unit in (None, "m")
    places = truth.positions @ TO_WORLD.T if truth.up == "y" else truth.positions
    return truth.frames - int(truth.first_index or 0), truth.ids, places


def _of_tracks(path: Path) -> Rows:
    """All columns of the formats that have them."""
    found = read_tracks(path)
    own = RUN.tracks
    assert found.settings["sequence"] == SEQUENCE.name
    assert found.settings["fusion.clutter_rate"] == str(RUN.settings["fusion.clutter_rate"])
    for name, atol in (
        ("existences", 0.5001e-4), ("sigmas", 0.5001e-4), ("covariances_xy", 0.5001e-6),
        ("heights", 0.5001e-4), ("sigma_heights", 0.5001e-4),
    ):  # fmt: skip
        np.testing.assert_allclose(getattr(found, name), getattr(own, name), atol=atol)
    for camera, (boxes, visible) in zip(SEQUENCE.cameras, RUN.boxes, strict=True):
        expected = np.where(visible[:, None], boxes, np.nan)
        np.testing.assert_allclose(found.boxes[camera.name], expected, atol=0.5001e-2)
    return found.frames, found.ids, found.positions


def _of_trc(path: Path) -> Rows:
    """As truth of an import, and as tracks to evaluate."""
    found = read_tracks(path)
    rows = _of_truth(path)
    order = np.lexsort([rows[1], rows[0]])
    for one, other in zip((found.frames, found.ids, found.positions), rows, strict=True):
        np.testing.assert_array_equal(one, other[order])
    return rows


def _of_motchallenge(path: Path) -> Rows:
    """The places of the ground plane; and in each camera the boxes."""
    for number, camera in enumerate(SEQUENCE.cameras):
        (file,) = path.glob(f"trackers/**/*-{camera.name}.txt")
        (piece,) = (own for own in read(file)[1] if isinstance(own, DetectionPiece))
        boxes, visible = RUN.boxes[number]
        np.testing.assert_array_equal(piece.frames - 1, RUN.tracks.frames[visible])
        np.testing.assert_allclose(piece.boxes, boxes[visible], atol=1e-6)
    (file,) = path.glob("trackers/**/*-ground-plane.txt")
    return _of_trc(file)


READERS: dict[str, Callable[[Path], Rows]] = {
    "csv": _of_tracks,
    "json": _of_tracks,
    "motchallenge": _of_motchallenge,
    "parquet": _of_tracks,
    "trc": _of_trc,
}

TO_LOOK_AT = {"gltf", "html", "mp4", "rerun"}
"""Formats that are drawings of the tracks."""


def test_every_format_is_read_back_or_drawn() -> None:
    assert READERS.keys() | TO_LOOK_AT == FORMATS.keys()


@pytest.mark.parametrize("name", READERS)
def test_tracks_come_back_with_their_ids_and_gaps(tmp_path: Path, name: str) -> None:
    if FORMATS[name].needs_package:
        pytest.importorskip(FORMATS[name].needs_package)
    path = tmp_path / f"tracks{FORMATS[name].suffix}"
    save(path, FORMATS[name], RUN)
    frames, ids, places = READERS[name](path)
    order = np.lexsort([ids, frames])
    np.testing.assert_array_equal(frames[order], RUN.tracks.frames)
    np.testing.assert_array_equal(ids[order], RUN.tracks.ids)
    np.testing.assert_allclose(places[order], RUN.tracks.positions, atol=0.5001e-4)


def test_the_truth_of_motchallenge_comes_back(tmp_path: Path) -> None:
    """In each camera the boxes of the people whose position is certain, at their steps."""
    own = RUN.tracks
    valid = own.ids != 4
    truth = GroundTruth(own.frames, own.ids, own.positions, valid)
    run = ExportedRun(replace(SEQUENCE, ground_truth=truth), own, RunParameters())
    save(tmp_path / "mot", FORMATS["motchallenge"], run)
    for number, camera in enumerate(SEQUENCE.cameras):
        (file,) = (tmp_path / "mot" / "gt").glob(f"**/*-{camera.name}/gt/gt.txt")
        (piece,) = read(file)[1]
        assert isinstance(piece, DetectionPiece)
        boxes, visible = run.boxes[number]
        assert piece.format == "MOTChallenge ground truth"
        assert piece.first_index == 1
        np.testing.assert_array_equal(piece.frames - 1, own.frames[visible & valid])
        np.testing.assert_allclose(piece.boxes, boxes[visible & valid], atol=1e-6)
        assert f"{int((visible & ~valid).sum())} of {int(visible.sum())} rows" in piece.left_out


def test_the_truth_on_the_ground_plane_comes_back_as_places(tmp_path: Path) -> None:
    own = RUN.tracks
    truth = GroundTruth(own.frames, own.ids, own.positions, own.ids != 4)
    run = ExportedRun(replace(SEQUENCE, ground_truth=truth), own, RunParameters())
    save(tmp_path / "mot", FORMATS["motchallenge"], run)
    (file,) = (tmp_path / "mot" / "gt").glob("**/*-ground-plane/gt/gt.txt")
    (piece,) = read(file)[1]
    assert isinstance(piece, TruthPiece)
    assert (piece.unit, piece.up, piece.first_index) == ("m", "z", 1)
    np.testing.assert_array_equal(piece.frames - 1, own.frames)
    np.testing.assert_array_equal(piece.ids, np.unique(own.ids, return_inverse=True)[1] + 1)
    np.testing.assert_allclose(piece.positions[:, :2], own.positions[:, :2], atol=1e-9)
    assert np.isnan(piece.positions[:, 2]).all()
    np.testing.assert_array_equal(piece.valid, own.ids != 4)


def test_descriptions_of_sequences_are_read_with_their_truth(tmp_path: Path) -> None:
    own = RUN.tracks
    truth = GroundTruth(own.frames, own.ids, own.positions, np.ones(len(own.ids), dtype=bool))
    run = ExportedRun(replace(SEQUENCE, ground_truth=truth), own, RunParameters())
    save(tmp_path / "mot", FORMATS["motchallenge"], run)
    found = {one.label: one for one in gather([tmp_path / "mot"])}
    assert [one.complaint for one in found.values() if one.complaint] == []
    descriptions = [label for label in found if label.endswith("seqinfo.ini")]
    assert len(descriptions) == 1 + len(SEQUENCE.cameras)
    for label in descriptions:
        assert found[label].read_with == label.replace("seqinfo.ini", "gt/gt.txt")


@pytest.mark.parametrize(("form", "suffix"), [("opencv", ".yml"), ("pose2sim", ".toml")])
def test_cameras_come_back(tmp_path: Path, form: str, suffix: str) -> None:
    path = tmp_path / f"cameras{suffix}"
    save_calibration(path, SEQUENCE.cameras, form)  # type: ignore[arg-type]
    for raw, camera in zip(raw_cameras(path), SEQUENCE.cameras, strict=True):
        assert (raw.name, raw.image_size) == (camera.name, camera.image_size)
        for part in ("intrinsics", "rotation", "translation"):
            np.testing.assert_allclose(getattr(raw, part), getattr(camera, part), atol=1e-9)
