"""A recording for Rerun's viewer: boxes and paths in 3D, cameras, and boxes in their pictures.

The entities are ``world/tracks``, ``world/ways/<id>``, ``world/room``, ``world/cameras/<name>``
with its pinhole, and ``world/cameras/<name>/tracks``; the timelines are ``step``, and ``time`` in
seconds.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tracker.export.exported_run import ExportedRun, Options
from tracker.export.palette import rgb

APPLICATION = "multiview-phd"
"""The name of the application in Rerun's viewer."""


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as a Rerun recording, step by step."""
    import rerun as rr

    sequence, tracks = run.sequence, run.tracks
    half = sequence.target_half_extents
    recording = rr.RecordingStream(APPLICATION)
    try:
        recording.save(path)
        recording.log("world", rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        room = sequence.room
        recording.log(
            "world/room",
            rr.Boxes3D(mins=[room.minimum], sizes=[room.maximum - room.minimum]),
            static=True,
        )
        for camera in sequence.cameras:
            place = f"world/cameras/{camera.name}"
            turned = rr.Transform3D(translation=camera.centre, mat3x3=camera.rotation.T)
            recording.log(place, turned, static=True)
            lens = rr.Pinhole(image_from_camera=camera.intrinsics, resolution=camera.image_size)
            recording.log(place, lens, static=True)
        for number in run.ids:
            way = tracks.positions[tracks.ids == number]
            recording.log(
                f"world/ways/{number}", rr.LineStrips3D([way], colors=[rgb(number)]), static=True
            )
        for step in range(run.steps):
            options.at(step, run.steps)
            recording.set_time("step", sequence=step)
            recording.set_time("time", duration=step * sequence.step_time)
            rows = tracks.at(step)
            ids = tracks.ids[rows].tolist()
            colours, labels = [rgb(number) for number in ids], [str(number) for number in ids]
            boxes = rr.Boxes3D(
                centers=tracks.positions[rows],
                half_sizes=np.tile(half, (len(ids), 1)),
                colors=colours,
                labels=labels,
            )
            recording.log("world/tracks", boxes)
            for index, camera in enumerate(sequence.cameras):
                pixels, visible = run.boxes[index]
                there = np.flatnonzero(visible[rows])
                shown = rr.Boxes2D(
                    array=pixels[rows][there],
                    array_format=rr.Box2DFormat.XYWH,
                    colors=[colours[k] for k in there],
                    labels=[labels[k] for k in there],
                )
                recording.log(f"world/cameras/{camera.name}/tracks", shown)
    finally:
        recording.flush()
        recording.disconnect()
    options.at(run.steps, run.steps)
