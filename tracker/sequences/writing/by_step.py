"""The writing of a recording as a sequence folder in which all files are indexed by step.

Each video has the picture of step k as frame k, in full size and at a low bit rate.
"""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from tracker.sequences.clock import FIELDS as CLOCK
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, View
from tracker.sequences.writing.teaching import taught_values

_QUALITY = {"preset": "veryfast", "crf": "32"}
"""The options of the encoder libx264."""

_REPLACED = ("video", "images", "first_frame", "background", "detections",
         "detections_first_frame", "detected_steps", "appearance", *CLOCK)  # fmt: skip
"""The fields of a camera that are written anew, since files are indexed by step; all others, such
as the calibration, are copied."""


def write_by_step(folder: Path, sequence: Sequence, *, videos: bool) -> None:
    """Write a recording into a new folder: boxes, ground truth and, if wanted, videos.

    Args:
        folder: The folder, which is made.
        sequence: The recording.
        videos: Whether the pictures are written; without them the file names no templates.
    """
    import tomlkit

    folder.mkdir()
    text = (sequence.folder / "sequence.toml").read_text(encoding="utf-8-sig")
    document = tomlkit.parse(text).unwrap()
    document |= {"name": sequence.name, "fps": sequence.fps, "frames": sequence.frames}
    taught = taught_values(sequence)
    document |= {"room": taught["room"], "target": taught["target"]}
    cameras: list[dict[str, Any]] = []
    for index, (view, original) in enumerate(zip(sequence.views, document["camera"], strict=True)):
        camera = {name: value for name, value in original.items() if name not in _REPLACED}
        camera["image_size"] = list(view.camera.image_size)
        name = f"camera{index + 1}"
        if view.detections is not None:
            camera |= _write_boxes(folder, name, view)
        if videos and view.has_pictures:
            camera["video"] = f"{name}.mp4"
            _write_video(folder / camera["video"], sequence, index)
            if isinstance(view.background, range):
                camera["background"] = [view.background[0], view.background[-1]]
            elif view.background is not None:
                camera["background"] = f"{name}-empty{view.background.suffix}"
                shutil.copyfile(view.background, folder / camera["background"])
        cameras.append(camera)
    document["camera"] = cameras
    if not videos:
        document.pop("template", None)
    document.pop("ground_truth", None)
    truth = sequence.ground_truth
    if truth is not None:
        document["ground_truth"] = {"file": "truth.csv"}
        columns = (truth.frames, truth.ids, truth.positions, truth.valid.astype(int))
        rows = zip(*(column.tolist() for column in columns), strict=True)
        _write_csv(
            folder / "truth.csv", "frame,id,x,y,z,valid",
            (f"{f},{n},{x:.9g},{y:.9g},{z:.9g},{valid}" for f, n, (x, y, z), valid in rows),
        )  # fmt: skip
    (folder / "sequence.toml").write_text(tomlkit.dumps(document), encoding="utf-8")


def _write_boxes(folder: Path, name: str, view: View) -> dict[str, str]:
    """Write the boxes of a camera, and return the fields that name the files."""
    boxes = view.detections
    assert boxes is not None
    fields = {"detections": f"{name}.csv"}
    rows = np.column_stack([boxes.frames, boxes.boxes, boxes.scores]).tolist()
    lines = [f"{int(row[0])}," + ",".join(f"{v:.9g}" for v in row[1:]) for row in rows]
    vectors = boxes.embeddings
    if view.detector_ran is not None:
        # steps at which the detector ran and found no box are listed too
        fields["detected_steps"] = "listed"
        empty = np.setdiff1d(np.flatnonzero(view.detector_ran), boxes.frames)
        lines += [f"{step},,,,," for step in empty.tolist()]
        vectors = np.pad(vectors, ((0, len(empty) if vectors.shape[1] else 0), (0, 0)))
    if vectors.shape[1]:
        fields["appearance"] = f"{name}.npy"
        np.save(folder / fields["appearance"], vectors)
    _write_csv(folder / fields["detections"], "frame,left,top,width,height,score", lines)
    return fields


def _write_csv(path: Path, head: str, rows: Iterable[str]) -> None:
    """Write a table from its first line and all others."""
    with path.open("w", encoding="utf-8", newline="\n") as file:
        file.writelines(f"{row}\n" for row in (head, *rows))


def _write_video(path: Path, sequence: Sequence, camera: int) -> None:
    """Write the pictures of the camera with an index as a video, black where a picture is
    missing."""
    import av

    width, height = sequence.views[camera].camera.image_size
    even = (width + width % 2, height + height % 2)
    with FrameReader(sequence) as reader, av.open(str(path), "w", format="mp4") as file:
        rate = Fraction(sequence.fps).limit_denominator(1000)
        stream = file.add_stream("libx264", rate=rate, options=_QUALITY)
        stream.width, stream.height = width, height
        # chroma at half resolution (4:2:0), which players expect, needs even sizes
        stream.pix_fmt = "yuv420p" if even == (width, height) else "yuv444p"
        nothing = np.zeros((height, width, 3), dtype=np.uint8)
        for picture in reader.iterate(camera):
            shown = nothing if picture is None else np.ascontiguousarray(picture)
            file.mux(stream.encode(av.VideoFrame.from_ndarray(shown, format="bgr24")))
        file.mux(stream.encode())
