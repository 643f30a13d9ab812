"""The writing of a recording as a sequence folder in which all files are indexed by step.

Each video has the picture of step k as frame k, in full size and at a low bit rate.
"""

from __future__ import annotations

import shutil
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from tracker.sequences.clock import FIELDS as CLOCK
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence, View
from tracker.sequences.tables import steps_without_boxes, write_boxes, write_truth
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
        write_truth(folder / "truth.csv", truth, decimals=".9g")
    (folder / "sequence.toml").write_text(tomlkit.dumps(document), encoding="utf-8")


def _write_boxes(folder: Path, name: str, view: View) -> dict[str, str]:
    """Write the boxes of a camera, and return the fields that name the files."""
    boxes = view.detections
    assert boxes is not None
    fields = {"detections": f"{name}.csv"}
    vectors = boxes.embeddings
    empty = np.zeros(0, dtype=np.int64)
    if view.detector_ran is not None:
        fields["detected_steps"] = "listed"
        empty = steps_without_boxes(boxes, np.flatnonzero(view.detector_ran))
        vectors = np.pad(vectors, ((0, len(empty) if vectors.shape[1] else 0), (0, 0)))
    if vectors.shape[1]:
        fields["appearance"] = f"{name}.npy"
        np.save(folder / fields["appearance"], vectors)
    write_boxes(folder / fields["detections"], boxes, empty, decimals=(".9g", ".9g"))
    return fields


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
