"""A small recording for the browser: numbered pictures, and boxes of two people who walk."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.synthetic import write_lines, write_sequence
from tracker.sequences.reader import read_sequence

FRAMES = 60


def write_walkers(folder: Path) -> Path:
    """A sequence of two cameras whose pictures say their step and whose boxes follow two people.

    Person 1 comes in at step 0, person 2 at step 20; every seventh box of a camera is missing
    and every third step has a false one.
    """
    write_sequence(folder, frames=FRAMES, detections=True, templates=False)
    sequence = read_sequence(folder)
    rng = np.random.default_rng(7)
    truth = []
    rows: dict[str, list[str]] = {view.camera.name: [] for view in sequence.views}
    entrance = (
        sequence.room.entrances[0].position if sequence.room.entrances else np.array([0, 0, 0.84])
    )
    goals = {1: np.array([-1.0, 0.6, entrance[2]]), 2: np.array([0.4, -1.0, entrance[2]])}
    for step in range(FRAMES):
        for person, goal in goals.items():
            since = step - 20 * (person - 1)
            if since < 0:
                continue
            position = entrance + (goal - entrance) * min(since / 35.0, 1.0)
            truth.append(f"{step},{person},{position[0]:.4f},{position[1]:.4f},{position[2]:.4f},1")
            for camera in sequence.cameras:
                (box,), (visible,) = camera.project_boxes(
                    position[None], sequence.target_half_extents
                )
                if visible and (step + person) % 7:
                    left, top, width, height = box + rng.normal(0.0, 0.5, 4)
                    rows[camera.name].append(
                        f"{step},{left:.2f},{top:.2f},{width:.2f},{height:.2f},0.9"
                    )
        if step % 3 == 0:
            for name in rows:
                x, y = rng.uniform(10, 150), rng.uniform(30, 90)
                rows[name].append(f"{step},{x:.2f},{y:.2f},20.00,40.00,0.3")
    for name, lines in rows.items():
        write_lines(folder / f"{name}.csv", "frame,left,top,width,height,score", lines)
    write_lines(folder / "ground_truth.csv", "frame,id,x,y,z,valid", truth)
    return folder
