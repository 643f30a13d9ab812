"""The process of a worker: it is prepared once, and then does one job after another.

This module does not depend on how jobs are distributed. The process keeps recordings open,
and caches the results of stages of its last runs, so that a trial that changes only the fusion
re-uses stage 1.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import cv2

from tracker.evaluation import evaluate_sequence
from tracker.files.folders import cache_folder
from tracker.kernels import compilation
from tracker.library.keeping import record_of_recording, record_of_run, thumbnail_of
from tracker.parameters.catalogue import METHODS, PARAMETERS, RunParameters
from tracker.parameters.values import value_of, with_values
from tracker.review.self_consistency import estimate
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.runs.stage_cache import StageCache
from tracker.runs.stage_files import StageFiles
from tracker.runs.warm_up import ensure_compiled
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.studies import transfer
from tracker.studies.jobs import Job, Outcome, figures_version
from tracker.studies.objectives import OBJECTIVES

CACHE_BYTES = 128 << 20
"""Memory of a worker for cached results of stages, bytes: mainly of stage 1, which is re-used by
all trials that change later stages alone."""

LATER_BYTES = 16 << 20
"""Part of this memory for stages after the first, bytes; it is small since other trials seldom
re-use their results."""

MOST_OPEN = 16
"""Largest number of recordings that a worker keeps open."""

FIRST_STEPS = 32
"""The number of steps that are computed first in order to load what a run needs."""

KNOWN_TIMES = 4096
"""Largest number of times of stage 1 that a worker stores in memory."""

NICENESS = 5
"""Niceness (priority in POSIX) of a worker on this machine, so that interactive programs come
first."""

Tell = Callable[[str], None]
"""A callback that gets a sentence on the progress."""


@dataclass
class _Process:
    """The state of a worker's process."""

    cache: StageCache
    """The cached results of stages."""
    opened: OrderedDict[str, tuple[Sequence, FrameReader]] = field(default_factory=OrderedDict)
    """The open recordings with their readers, by the hash of their content, the last used last."""
    stage_seconds: OrderedDict[str, float] = field(default_factory=OrderedDict)
    """Processor time of stage 1, seconds, by the key of the stage."""
    loaded: set[tuple[object, ...]] = field(default_factory=set)
    """The recordings, and the values of choices and switches, whose code is loaded."""
    lock: threading.Lock = field(default_factory=threading.Lock)
    """The lock that the thread of a job holds."""


_process: _Process | None = None
_preparing = threading.Lock()


def machine() -> str:
    """Return this machine's name."""
    return platform.node()


def lower_priority() -> None:
    """Lower the priority of this process to :data:`NICENESS`."""
    if sys.platform != "win32":
        os.nice(max(0, NICENESS - os.nice(0)))


def prepare(tell: Tell = lambda words: None) -> None:
    """Compile the kernels, once for the machine while its other workers wait, and set up the cache.

    Args:
        tell: A callback that gets a sentence on the progress.
    """
    global _process
    with _preparing:
        if _process is not None:
            return
        cv2.setNumThreads(1)
        ensure_compiled(tell)
        files = StageFiles(cache_folder() / "stages")
        _process = _Process(
            StageCache(memory_bytes=CACHE_BYTES, later_bytes=LATER_BYTES, files=files)
        )


def work(job: Job, tell: Tell = lambda words: None, worker: str = "") -> Outcome:
    """Do a job; its errors are part of the outcome and are not raised.

    Args:
        job: The job.
        tell: A callback that gets a sentence on the progress.
        worker: The name of the worker.
    """
    begin = time.perf_counter()
    if job.code != figures_version():
        return Outcome(job.key, "version", figures_version(), worker=worker, machine=machine())
    prepare(tell)
    assert _process is not None
    with _process.lock:  # one job at a time, since processor time is measured for the process
        try:
            sequence, reader = _opened(job, tell)
        except SequenceError as error:
            words = " ".join(str(error).split())
            return Outcome(job.key, "unreadable", words, worker=worker, machine=machine())
        try:
            results = _done(job, sequence, reader)
        except (ValueError, OSError, ArithmeticError, MemoryError) as error:
            words = " ".join(str(error).split()) or type(error).__name__
            return Outcome(job.key, "failed", words, worker=worker, machine=machine())
    seconds = time.perf_counter() - begin
    return Outcome(job.key, "done", seconds=seconds, worker=worker, machine=machine(), **results)


def _opened(job: Job, tell: Tell) -> tuple[Sequence, FrameReader]:
    """Return the recording of a job and its reader, which remain open."""
    assert _process is not None
    kept = _process.opened
    if job.content in kept:
        kept.move_to_end(job.content)
        return kept[job.content]
    tell(f"opens {job.place}")
    sequence = transfer.opened(job.place, job.content)
    tell("")
    kept[job.content] = sequence, FrameReader(sequence)
    while len(kept) > MOST_OPEN:
        kept.popitem(last=False)[1][1].close()
    return kept[job.content]


def _done(job: Job, sequence: Sequence, reader: FrameReader) -> dict[str, Any]:
    """Track and evaluate a recording, and return the fields of the outcome by name."""
    parameters = with_values(pipeline.default_parameters(sequence), job.values)
    if job.timed:
        _load(job, sequence, parameters, reader)
    began, begin = time.time(), time.perf_counter()
    run, seconds = _tracked(job, sequence, parameters, reader)
    took = time.perf_counter() - begin
    figures: dict[str, float | None] = {"speed": None}
    if seconds is not None:
        figures["speed"] = sequence.frames / max(seconds, 1e-9)
    evaluation = evaluate_sequence(sequence, run.tracks) if job.truth else None
    if evaluation is not None:
        figures |= {
            one.definition.key: one.value
            for one in evaluation.figures
            if one.definition.key in OBJECTIVES
        }
        hota, idf1 = figures.get("hota"), figures.get("idf1")
        # without any tracks the figures are not defined, and the score is 0
        figures["score"] = ((hota or 0.0) + (idf1 or 0.0)) / 2.0
    overlap = None
    if job.agreement:
        estimated = estimate(run)
        found = [one for one in estimated.overlaps if one is not None]
        overlap = sum(found) / len(estimated.overlaps) if estimated.overlaps else None
        figures["identity"] = estimated.score if len(run.tracks) else 0.0
    kept = None
    if job.keep:
        recording = record_of_recording(sequence, job.place, thumbnail_of(sequence, reader))
        kept = (
            recording,
            record_of_run(run, source="batch", began=began, seconds=took, evaluation=evaluation),
        )
    return {
        "figures": figures,
        "overlap": overlap,
        "tracks": tracks_hash(run),
        "people": len(set(run.tracks.ids.tolist())),
        "kept": kept,
    }


def _load(job: Job, sequence: Sequence, parameters: RunParameters, reader: FrameReader) -> None:
    """Load the modules and the machine code that a run needs, so that its time is that of the run.

    The first steps are computed, then as many again, until no kernel was loaded by the last ones.
    """
    assert _process is not None
    values = (value_of(parameters, key) for key in (*METHODS, *PARAMETERS))
    which = (job.content, *(value for value in values if isinstance(value, str | bool)))
    if which in _process.loaded:
        return
    run, steps, loaded = None, FIRST_STEPS, -1
    while (run is None or not run.complete) and compilation.counts()[0] > loaded:
        loaded = compilation.counts()[0]
        run = pipeline.compute(
            sequence, parameters, seed=job.seed, corrections=job.corrections, steps=steps,
            reader=reader, previous=run,
        )  # fmt: skip
        steps *= 2
    _process.loaded.add(which)


def _tracked(
    job: Job, sequence: Sequence, parameters: RunParameters, reader: FrameReader
) -> tuple[Run, float | None]:
    """Return the run, and the processor time that it takes without a cache, seconds.

    Stage 1 has threads of its own, whose time is the time of the process minus that of this thread.
    The time is None if stage 1 is in the cache and its time is not known; but if the job must be
    timed, stage 1 is computed again.
    """
    assert _process is not None
    key = pipeline.stage_keys(sequence, parameters, job.seed)["single_view"]
    known = _process.stage_seconds.get(key)
    if known is None:
        known = _read_seconds(key)
    cache = _process.cache if known is not None or not job.timed else None
    began: set[str] = set()
    whole, own = time.process_time(), time.thread_time()
    run = pipeline.compute(
        sequence,
        parameters,
        seed=job.seed,
        corrections=job.corrections,
        reader=reader,
        cache=cache,
        on_progress=lambda _, progress: began.add(progress.stage),
    )
    own = time.thread_time() - own
    if "single_view" in began:
        known = max(0.0, time.process_time() - whole - own)
        _write_seconds(key, known, run)
        if cache is None:  # put the results of stages into the cache for the next trials
            pipeline.compute(
                sequence, parameters, seed=job.seed, corrections=job.corrections, previous=run,
                cache=_process.cache,
            )  # fmt: skip
    return run, None if known is None else known + own


def _read_seconds(key: str) -> float | None:
    """Return the processor time of stage 1 that a process of this machine measured, seconds; None
    if none did."""
    try:
        return float((cache_folder() / "stage-seconds" / key).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def _write_seconds(key: str, seconds: float, run: Run) -> None:
    """Store the processor time of stage 1, seconds, in memory and for other processes."""
    assert _process is not None
    known = _process.stage_seconds
    known[key] = seconds
    while len(known) > KNOWN_TIMES:
        known.popitem(last=False)
    # the results of stage 1 are on disk, so that other processes need the time
    if run.from_pictures:
        place = cache_folder() / "stage-seconds"
        try:
            place.mkdir(parents=True, exist_ok=True)
            (place / key).write_text(repr(seconds), encoding="ascii")
        except OSError:
            pass  # other processes measure the time again


def tracks_hash(run: Run) -> str:
    """Return the hash of a run's tracks, without components and labels."""
    digest = hashlib.sha256()
    for name in ("frames", "ids", "positions", "existences", "sigmas", "seen"):
        digest.update(getattr(run.tracks, name).tobytes())
    return digest.hexdigest()[:24]


def dask_setup(worker: Any) -> None:
    """Prepare a worker's process on this machine before its first job; Dask calls it."""
    lower_priority()
    prepare()
