"""Sequences and runs that the experiments share, and the same pictures seen by fewer cameras."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Sequence as Items
from dataclasses import dataclass, replace

from tests import rooms
from tests.papers.laboratory.experiment import Context, Unavailable
from tracker.fusion.trajectories import Trajectories
from tracker.parameters.catalogue import RunParameters
from tracker.runs import pipeline
from tracker.runs.pipeline import Cancelled, Progress, Run
from tracker.runs.processes import WorkerControl
from tracker.sequences.built_in import cached_rooms
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence


@dataclass(frozen=True, slots=True, eq=False)
class Timed:
    """A run and how long it took."""

    run: Run
    seconds: float

    @property
    def steps_per_second(self) -> float:
        """With all cores."""
        return self.run.done / self.seconds


def room(context: Context, name: str, steps: int | None = None) -> Sequence:
    """A rendered room from the cache; rendered first where it is not there.

    Args:
        context: Whom to tell.
        name: One of ``rooms.ROOMS``.
        steps: Only so many, as a sequence of its own.
    """

    def told(done: int, total: int) -> None:
        context.told(f"rendering {name}", done, total)

    try:
        whole = cached_rooms() / f"{name}-2-cameras"
        folder = whole if steps is None else whole.with_name(f"{whole.name}-{steps}-steps")
        if folder.exists():
            try:
                return read_sequence(folder)
            except SequenceError:
                pass  # somebody spoilt it; it is replaced
        rooms.render(name, folder, frames=steps, progress=told, cancelled=context.cancelled)
        return read_sequence(folder)
    except rooms.RenderCancelled:
        raise Cancelled from None


def recording(context: Context, name: str) -> Sequence:
    """A real recording.

    Raises:
        Unavailable: If it is not in the data folder.
    """
    if context.data is None or not (context.data / name / "sequence.toml").is_file():
        where = "no folder of recordings is named" if context.data is None else f"{context.data}"
        raise Unavailable(
            f"the real recording {name} is not at hand ({where}); name the folder that holds it: "
            "--data DIR"
        )
    return read_sequence(context.data / name)


def computed(context: Context, sequence: Sequence, steps: int | None = None) -> Timed:
    """The run of a sequence with its default parameters and seed 0; each is computed once."""
    parameters = pipeline.default_parameters(sequence)
    total = sequence.frames if steps is None else min(steps, sequence.frames)
    key = f"{pipeline.stage_keys(sequence, parameters, 0)['tracks']}-{total}"
    if key not in context.shared:
        words = f"tracking in {sequence.name}"
        context.told(words, 0, total)
        begin = time.perf_counter()
        run = pipeline.compute(
            sequence,
            parameters,
            steps=steps,
            on_progress=lambda _, progress: context.told(words, progress.done, progress.total),
            cancelled=context.cancelled,
        )
        context.shared[key] = Timed(run, time.perf_counter() - begin)
    timed: Timed = context.shared[key]
    return timed


def tracked(
    sequence: Sequence,
    parameters: RunParameters,
    control: WorkerControl,
    *,
    seed: int,
    steps: int,
    reader: FrameReader | None = None,
) -> Run:
    """A run inside a piece of work."""
    told = 0

    def advance(_: Run, progress: Progress) -> None:
        nonlocal told
        control.advance(progress.done - told)
        told = progress.done

    return pipeline.compute(
        sequence,
        parameters,
        seed=seed,
        steps=steps,
        reader=reader,
        on_progress=advance,
        cancelled=control.cancelled,
    )


def with_cameras(sequence: Sequence, cameras: Items[int]) -> Sequence:
    """The same sequence seen by some of its cameras."""
    names = ",".join(map(str, cameras))
    digest = hashlib.sha256(f"{sequence.digest} {names}".encode()).hexdigest()
    return replace(sequence, views=tuple(sequence.views[c] for c in cameras), digest=digest)


def fused_again(
    run: Run, cameras: Items[int], parameters: RunParameters | None = None
) -> Trajectories:
    """What the fusion makes of the boxes that some cameras found in a run.

    Args:
        run: Its stage 1 is used as it is; each camera's is independent of the others.
        cameras: Their indices.
        parameters: Those of the run, if none; only the fusion's count.
    """
    parameters = parameters or run.parameters
    sequence = with_cameras(run.sequence, cameras)
    keys = pipeline.stage_keys(sequence, parameters, run.seed)
    seen = Run(sequence, parameters, run.seed, keys)
    seen.views = run.views.parts(cameras)
    done = pipeline.compute(
        sequence, parameters, seed=run.seed, steps=len(run.views), previous=seen
    )
    return done.filtered
