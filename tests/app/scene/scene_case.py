"""A small room with walkers, cameras and a finished run, for tests of the 3D view."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy import ndarray

from app.state.workbench import Workbench
from tracker.filters.gaussian_mixture import GaussianMixture
from tracker.fusion import trajectories
from tracker.fusion.protocol import FusionResult
from tracker.geometry.camera import Camera
from tracker.parameters.catalogue import RunParameters
from tracker.runs.pipeline import Progress, Run, stage_keys
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Entrance, GroundTruth, Room, Sequence, View

ROOM = Room(
    np.array([-1.5, -1.5, 0.0]),
    np.array([1.5, 1.5, 2.0]),
    (Entrance(np.array([1.3, 0.0, 0.9]), np.array([0.3, 0.3, 0.1])),),
)
HALF = np.array([0.3, 0.3, 0.84])


def camera(index: int, count: int, distortion: float = -0.25) -> Camera:
    """One of several around the room, looking at its middle."""
    angle = 0.4 + 2.0 * np.pi * index / count
    eye = np.array([3.2 * np.cos(angle), 3.2 * np.sin(angle), 2.6])
    ahead = np.array([0.0, 0.0, 0.8]) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    intrinsics = np.array([[380.0, 0.0, 172.0], [0.0, 415.0, 150.0], [0.0, 0.0, 1.0]])
    lens = np.array([distortion, 0.0, 0.002, -0.003, 0.0])
    return Camera(f"cam{index + 1}", (360, 288), intrinsics, rotation, -rotation @ eye, lens)


def sequence(cameras: int = 3, frames: int = 60, name: str = "walk") -> Sequence:
    """Two walkers with truth; no pictures."""
    steps = np.arange(frames)
    return Sequence(
        name=name,
        folder=Path(),
        fps=10.0,
        frames=frames,
        room=ROOM,
        target_half_extents=HALF,
        views=tuple(View(camera(i, cameras)) for i in range(cameras)),
        ground_truth=GroundTruth(
            np.repeat(steps, 2),
            np.tile([1, 2], frames),
            np.stack([walker(k, who) for k in steps for who in (0, 1)]),
            np.ones(2 * frames, dtype=bool),
        ),
        digest=name,
    )


def walker(step: int, who: int) -> ndarray:
    """Where a walker is."""
    angle = 0.05 * step + np.pi * who
    return np.array([np.cos(angle), np.sin(angle), 0.84])


def run(of: Sequence, done: int | None = None, clutter: int = 4, walkers: int = 2) -> Run:
    """A run that found the walkers, with light components beside them."""
    parameters = RunParameters(single_view="none")
    result = Run(of, parameters, 0, stage_keys(of, parameters, 0))
    rng = np.random.default_rng(1)
    count = walkers + clutter
    for step in range(of.frames if done is None else done):
        factors = rng.normal(size=(count, 3, 3)) * 0.1
        posterior = GaussianMixture(
            np.array([0.97] * walkers + [0.05] * clutter),
            np.concatenate(
                [
                    [walker(step + 7 * (who // 2), who) for who in range(walkers)],
                    rng.uniform(ROOM.minimum, ROOM.maximum, (clutter, 3)),
                ]
            ),
            factors @ factors.transpose(0, 2, 1) + 1e-3 * np.eye(3),
            np.arange(50, 50 + count),
        )
        shape = (len(of.views), count)
        sources = np.zeros(shape, dtype=np.int64)
        sources[:, 0] = -1 if 20 <= step < 26 else 0  # the first one coasts for a while
        result.fused.append(
            FusionResult(posterior, np.ones(shape), sources, np.ones(shape), np.full(shape, -1))
        )
    result.tracks = trajectories.extract(
        result.fused, cameras=len(of.views), extraction_threshold=0.5
    )
    result.done = len(result.fused)
    result.finished = result.complete
    return result


def opened(of: Sequence, shown: Run | None = None) -> Workbench:
    """A workbench with the sequence and, where given, a finished run; every layer is on."""
    workbench = Workbench()
    workbench.set_layers({"truth": True})
    show(workbench, of, shown)
    return workbench


def show(workbench: Workbench, of: Sequence, shown: Run | None = None) -> None:
    """Open a sequence in a workbench, and its run."""
    workbench.open(of, of.name, FrameReader(of), RunParameters(single_view="none"))
    if shown is not None:
        workbench.run_begins(shown.key)
        workbench.run_progresses(shown, Progress("tracks", shown.done, of.frames, 1.0, shown.done))
        workbench.run_ends(shown.key, "done")
