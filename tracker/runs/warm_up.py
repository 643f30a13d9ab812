"""The compilation of all kernels ahead of the first run, by a few steps of every method.

numba compiles a function when it is first called, for the types of its arguments.
So a tiny synthetic recording is tracked with each method and with all parameters that select
other kernels; the first real run then finds its kernels compiled.

``python -m tracker.runs.warm_up`` does this in two processes, one for each half of the methods,
so that the workbench's own interpreter stays responsive. Each process prints its progress: a line
``done total`` whenever a kernel has been compiled. The first half prints ``ready`` when the
default method of a sequence with templates has those kernels that cannot run as plain Python.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable, Iterable
from contextlib import ExitStack, suppress
from itertools import chain
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from tracker import fusion, single_view, smoothing
from tracker.files.lock import locked
from tracker.geometry.camera import Camera
from tracker.kernels import compilation
from tracker.parameters import Method, MethodKey
from tracker.parameters.catalogue import (
    DEFAULT_CANDIDATES,
    METHODS,
    ORIGINS,
    PRESETS,
    REGISTERED,
    RunParameters,
)
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.sequence import Detections, Entrance, Room, Sequence, Template, View

MAKERS: dict[MethodKey, Callable[[Method], Callable[..., Any]]] = {
    "single_view": single_view.maker,
    "fusion_method": fusion.maker,
    "smoothing_method": smoothing.maker,
}
"""The function that imports a method of each stage."""

STEPS = 44
"""The number of steps of the synthetic recording: enough boxes for their noise to be estimated."""

EMPTY = 12
"""The number of steps before people appear, from which the background is learnt."""

SIZE = (160, 120)
"""Width and height of a picture, pixels."""

_HALF_EXTENTS = np.array([0.3, 0.3, 0.84])
_WAYS = (((-1.2, 0.2, 0.84), (1.2, 0.2, 0.84)), ((1.2, -0.3, 0.84), (-1.2, -0.3, 0.84)))
"""First and last position of each of two people, who pass each other, metres."""

_COLOURS = ((40, 40, 220), (220, 60, 40))
"""The colours of the two people, blue, green and red."""

HALVES = ("first", "second")
"""The two halves of the work: stage 1 with the PHD filter; and the step of the multi-Bernoulli
filter, which takes longest to compile, with the smoothing."""

COMPILING = "compiling the kernels, once per machine"
"""The sentence that is reported while kernels are compiled."""

WAITING = "waiting for another program that compiles the kernels, once per machine"
"""The sentence that is reported while another caller's processes compile."""

BACKGROUND = "--background"
"""The argument with which a process that compiles gives way to rendering and tracking."""

_SECONDS_BETWEEN = 0.1
"""Interval at which the processes that compile are looked at, seconds."""

_OTHER_WAYS = (
    {"fusion.update": "unscented"},
    {"fusion.measurement": "centre", "fusion.motion": "random_walk"},
    {"fusion.measurement": "box_and_width", "fusion.extraction": "boxes"},
    {"single_view": "colour_phd", "foreground.model": "adaptive"},
)
"""Parameters that select kernels which neither the defaults nor a preset use."""


def compile_kernels(
    half: str,
    progress: Callable[[int, int], None] = lambda done, total: None,
    ready: Callable[[], None] = lambda: None,
) -> None:
    """Compile the kernels that have not been compiled on this machine.

    Args:
        half: The half of the methods, one of :data:`HALVES`.
        progress: A callback that gets the number of compiled kernels and of all, whenever one has
            been compiled.
        ready: A callback that the first half calls when the default method of a sequence with
            templates has the kernels that cannot run as plain Python.
    """
    for key, maker in MAKERS.items():
        for method in REGISTERED[key].values():
            if method.name not in ORIGINS:
                maker(method)  # imports its kernels, so that the total is known from the start
    with (
        tempfile.TemporaryDirectory() as folder,
        compilation.followed(lambda: progress(*compilation.counts())),
    ):
        recording = _recording(Path(folder))
        if half == HALVES[0]:
            for single_view in DEFAULT_CANDIDATES:
                with compilation.only_of_pixels():
                    pipeline.compute(recording, RunParameters(single_view=single_view))
                if single_view == DEFAULT_CANDIDATES[0]:
                    ready()
        for parameters in _ways(half):
            pipeline.compute(recording, parameters)
        if half == HALVES[0]:  # no run waits for what an import needs
            _import(recording)


def _import(recording: Sequence) -> None:
    """Judge how calibration and boxes are meant, compare clocks, and assign calibrations."""
    # who only waits for the kernels does not load the import
    from tracker.io.checks import check
    from tracker.io.checks.boxes import raw_cameras
    from tracker.io.conventions.judge import Seen
    from tracker.io.conventions.reading import Reading
    from tracker.io.conventions.search import Likelihood

    check(recording, pictures=False)
    seen = [
        None if own is None else Seen(own.frames, own.boxes)
        for own in (view.detections for view in recording.views)
    ]
    likelihood = Likelihood(raw_cameras(recording), seen, recording.fps)
    likelihood.likely_orders(Reading(), (2,))


def _ways(half: str) -> Iterable[RunParameters]:
    """Return parameters that between them use every kernel, the most common ones first."""
    of_views = (
        with_values(
            RunParameters(),
            {
                **preset,
                "single_view": single_view,
                "fusion_method": "sequential_phd",
                "smoothing_method": "none",
            },
        )
        for preset in PRESETS.values()
        for single_view in _own("single_view")
    )
    of_fusions = (
        with_values(
            RunParameters(), {"single_view": "none", **values, "fusion_method": fusion_method}
        )
        for values in (*PRESETS.values(), *_OTHER_WAYS)
        for fusion_method in _own("fusion_method")
    )
    of_smoothings = (
        RunParameters(single_view=single_view, smoothing_method=smoothing_method)
        for single_view in DEFAULT_CANDIDATES
        for smoothing_method in _own("smoothing_method")
    )
    # the orders are opposite, so that neither process waits for what the other compiles
    if half == HALVES[0]:
        return of_views
    boxes = RunParameters(single_view="none")
    return chain([boxes], of_smoothings, of_fusions)


def _own(key: MethodKey) -> list[str]:
    """Return the names of this project's methods that have kernels: those of plugins are compiled
    when they are called, and a detection network has none."""
    return [
        name
        for name in METHODS[key]
        if name not in ORIGINS and not REGISTERED[key][name].used(RunParameters()).detector
    ]


def _recording(folder: Path) -> Sequence:
    """Make a recording of two people who cross a room, by two cameras with pictures and boxes."""
    rng = np.random.default_rng(0)
    share = np.linspace(0.0, 1.0, STEPS - EMPTY)[:, None]
    paths = [np.array(one) * (1.0 - share) + np.array(other) * share for one, other in _WAYS]
    cameras = (_camera("left", -3.2), _camera("right", 3.2))
    views = []
    for camera in cameras:
        rows, boxes, images = [], [], []
        wall = rng.integers(90, 130, (SIZE[1], SIZE[0], 3), dtype=np.uint8)
        for step in range(STEPS):
            picture = wall.copy()
            people = np.array([path[step - EMPTY] for path in paths if step >= EMPTY])
            found, visible = camera.project_boxes(people.reshape(-1, 3), _HALF_EXTENTS)
            for box, colour in zip(found[visible], _COLOURS, strict=False):
                left, top, width, height = box.round().astype(int).tolist()
                cv2.rectangle(picture, (left, top), (left + width, top + height), colour, -1)
                rows.append(step)
                boxes.append(box)
            images.append(folder / f"{camera.name}{step}.png")
            cv2.imwrite(str(images[-1]), picture)
        detections = Detections(
            np.array(rows, dtype=np.int64), np.array(boxes).reshape(-1, 4), np.ones(len(rows))
        )
        views.append(View(camera, images=tuple(images), detections=detections))
    first = views[0].detections
    assert first is not None
    return Sequence(
        name="warm-up",
        folder=folder,
        fps=25.0,
        frames=STEPS,
        room=Room(
            np.array([-1.5, -1.5, 0.0]),
            np.array([1.5, 1.5, 2.0]),
            (Entrance(np.array([1.0, -0.3, 0.84]), np.full(3, 0.3)),),
        ),
        target_half_extents=_HALF_EXTENTS,
        views=tuple(views),
        templates=tuple(
            Template(f"person{number}", "left", EMPTY, box)
            for number, box in enumerate(first.boxes[first.at(EMPTY)])
        ),
    )


def _camera(name: str, place: float) -> Camera:
    """Make a camera at one side of the room that looks at its middle."""
    position = np.array([place, -3.4, 1.6])
    ahead = np.array([0.0, 0.0, 0.9]) - position
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    rotation = np.stack([right, np.cross(ahead, right), ahead])
    intrinsics = np.array([[150.0, 0, SIZE[0] / 2], [0, 150.0, SIZE[1] / 2], [0, 0, 1]])
    distortion = np.array([-0.2, 0.01, 0.001, -0.001, 0.0])
    return Camera(name, SIZE, intrinsics, rotation, -rotation @ position, distortion)


def ensure_compiled(
    tell: Callable[[str], None] = lambda words: None,
    *,
    progress: Callable[[int, int], None] = lambda done, total: None,
    ready: Callable[[], None] = lambda: None,
    stopped: Callable[[], bool] = lambda: False,
    background: bool = False,
) -> int:
    """Compile all kernels, unless that was done on this machine, and return when they are there.

    Two processes compile, for one caller of the machine at a time; the others wait, and go on
    where it was ended.

    Args:
        tell: A callback that gets a sentence if there is something to compile, and again with
            each kernel that is there.
        progress: A callback that gets the number of compiled kernels and of all.
        ready: A callback that is called when the first run may begin.
        stopped: A function that returns whether to end the processes; what they compiled remains.
        background: Whether the processes get a lower priority, because nobody waits for all
            kernels.

    Returns:
        0 if all kernels are compiled, else the status of a process that failed or was ended.

    Raises:
        OSError: If no process can be started.
    """
    if compilation.is_compiled():
        return 0
    tell(COMPILING)
    waits = False

    def wait() -> bool:
        nonlocal waits
        if not waits:
            waits = True
            tell(WAITING)
        ready()  # what another caller's processes have compiled is used from now on
        compilation.news_of_compiling()
        return not stopped()

    def count(done: int, total: int) -> None:
        progress(done, total)
        tell(f"{COMPILING}, {done} of {total}")

    with ExitStack() as held:
        with suppress(OSError):  # nothing can be stored: each caller compiles for itself
            held.enter_context(locked(compilation.kernel_folder() / "compiling", wait=wait))
        if not compilation.is_compiled() and not stopped():
            return _compile_in_processes(count, ready, stopped, background)
    return int(not compilation.is_compiled())


def _compile_in_processes(
    progress: Callable[[int, int], None],
    ready: Callable[[], None],
    stopped: Callable[[], bool],
    background: bool,
) -> int:
    """Run a process for each half, and follow what they print until both have ended."""
    counts: dict[str, tuple[int, int]] = {}

    def follow(half: str, process: subprocess.Popen[str]) -> None:
        assert process.stdout is not None
        with process.stdout:
            for line in process.stdout:
                words = line.split()
                if words == ["ready"]:
                    compilation.mark_pixels_compiled()
                    ready()
                elif len(words) == 2:
                    counts[half] = int(words[0]), int(words[1])
                    compilation.news_of_compiling()
                    progress(*max(counts.values()))
        if process.wait() != 0:  # it will not print that it is ready
            ready()

    readers: list[tuple[threading.Thread, subprocess.Popen[str]]] = []
    try:
        flags = [BACKGROUND] if background else []
        for half in HALVES:
            process = subprocess.Popen(
                [sys.executable, "-m", "tracker.runs.warm_up", *flags, half], text=True,
                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
            )  # fmt: skip
            reader = threading.Thread(
                target=follow, args=(half, process), name=f"compiling {half}", daemon=True
            )
            readers.append((reader, process))
            reader.start()
        while any(reader.is_alive() for reader, _ in readers) and not stopped():
            next(reader for reader, _ in readers if reader.is_alive()).join(_SECONDS_BETWEEN)
    finally:
        for _, process in readers:
            process.terminate()
        statuses = [process.wait() for _, process in readers]
        for reader, _ in readers:
            reader.join()
    if not any(statuses):
        compilation.mark_compiled()
    return max(statuses, key=abs)


def main() -> int:
    """Compile one half and print the progress, or compile both in processes."""
    if len(sys.argv) < 2:
        return ensure_compiled()
    half, background = sys.argv[-1], BACKGROUND in sys.argv
    if background:
        _give_way(5 if half == HALVES[0] else 19)

    def report(line: str) -> None:
        sys.stdout.write(f"{line}\n")
        sys.stdout.flush()

    def ready() -> None:
        report("ready")
        if background:
            _give_way(10)

    compile_kernels(half, lambda done, total: report(f"{done} {total}"), ready)
    return 0


def _give_way(steps: int) -> None:
    """Lower the priority of this process by so many steps, below that of rendering and tracking."""
    if sys.platform != "win32":
        os.nice(steps)


if __name__ == "__main__":
    sys.exit(main())
