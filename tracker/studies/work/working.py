"""What a worker does: prepare itself once, then one job after the other.

Nothing here knows who distributes the jobs. A process keeps the recordings that it opened, and
the columns of its last runs: a trial that changes only the fusion takes stage 1 from there.
"""

from __future__ import annotations

import hashlib
import os
import platform
import sqlite3
import subprocess
import sys
import threading
import time
from collections import OrderedDict
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from typing import Any

import cv2

from tracker.evaluation import evaluate_sequence
from tracker.files.folders import cache_folder
from tracker.kernels import compilation
from tracker.library.keeping import recording_of, run_of, thumbnail_of
from tracker.parameters import with_values
from tracker.review.self_consistency import estimate
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.runs.stage_cache import StageCache
from tracker.runs.stage_files import StageFiles
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.sequence import Sequence
from tracker.studies.defined.objectives import OBJECTIVES
from tracker.studies.work import recordings
from tracker.studies.work.jobs import Job, Outcome, code_version

CACHE_BYTES = 128 << 20
"""Memory of a worker for columns of runs, above all of stage 1, which every trial uses that changes
what comes after."""

LATER_BYTES = 16 << 20
"""Of this for the stages after the first, which hardly any other trial uses: a worker has soon
taken all that it ever takes."""

MOST_OPEN = 16
"""Recordings that a worker keeps open."""

KNOWN_TIMES = 4096

NICENESS = 5
"""Of a worker on this machine: whoever uses it goes first."""

COMPILING = "compiling the kernels, once per machine"

Tell = Callable[[str], None]


@dataclass
class _Process:
    """What a worker's process keeps."""

    cache: StageCache
    opened: OrderedDict[str, tuple[Sequence, FrameReader]] = field(default_factory=OrderedDict)
    stage_seconds: OrderedDict[str, float] = field(default_factory=OrderedDict)
    """Processor time of stage 1, by its key."""
    lock: threading.Lock = field(default_factory=threading.Lock)


_process: _Process | None = None
_preparing = threading.Lock()


def machine() -> str:
    """This machine's name."""
    return platform.node()


def give_way() -> None:
    """Have whoever uses this machine go first."""
    if sys.platform != "win32":
        os.nice(max(0, NICENESS - os.nice(0)))


def prepare(tell: Tell = lambda words: None) -> None:
    """Have the kernels compiled, once a machine; other workers of the machine wait for it.

    Args:
        tell: Told what is being waited for.
    """
    global _process
    with _preparing:
        if _process is not None:
            return
        cv2.setNumThreads(1)
        if not compilation.is_compiled():
            tell(COMPILING)
            _compile()
        files = StageFiles(cache_folder() / "stages")
        _process = _Process(
            StageCache(memory_bytes=CACHE_BYTES, later_bytes=LATER_BYTES, files=files)
        )


def _compile() -> None:
    """In two processes, one worker a machine at a time; a worker that dies holds up nobody."""
    folder = compilation.kernel_folder()
    folder.mkdir(parents=True, exist_ok=True)
    with closing(sqlite3.connect(folder / "compiling.lock", timeout=600.0)) as lock:
        lock.isolation_level = None
        lock.execute("BEGIN EXCLUSIVE")  # the system frees it with the process
        if not compilation.is_compiled():
            line = [sys.executable, "-m", "tracker.runs.warm_up"]
            subprocess.run(line, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, check=False)


def work(job: Job, tell: Tell = lambda words: None, worker: str = "") -> Outcome:
    """Do a job. What is wrong with it is part of the outcome, never raised.

    Args:
        job: What to do.
        tell: Told what is being done.
        worker: Who does it.
    """
    begin = time.perf_counter()
    if job.code != code_version():
        return Outcome(job.key, "version", code_version(), worker=worker, machine=machine())
    prepare(tell)
    assert _process is not None
    with _process.lock:  # processor time is the process's: one job at a time
        try:
            sequence, reader = _opened(job, tell)
        except SequenceError as error:
            words = " ".join(str(error).split())
            return Outcome(job.key, "unreadable", words, worker=worker, machine=machine())
        try:
            told = _done(job, sequence, reader)
        except (ValueError, OSError, ArithmeticError, MemoryError) as error:
            words = " ".join(str(error).split()) or type(error).__name__
            return Outcome(job.key, "failed", words, worker=worker, machine=machine())
    seconds = time.perf_counter() - begin
    return Outcome(job.key, "done", seconds=seconds, worker=worker, machine=machine(), **told)


def _opened(job: Job, tell: Tell) -> tuple[Sequence, FrameReader]:
    assert _process is not None
    kept = _process.opened
    if job.content in kept:
        kept.move_to_end(job.content)
        return kept[job.content]
    tell(f"opens {job.place}")
    sequence = recordings.opened(job.place, job.content)
    tell("")
    kept[job.content] = sequence, FrameReader(sequence)
    while len(kept) > MOST_OPEN:
        kept.popitem(last=False)[1][1].close()
    return kept[job.content]


def _done(job: Job, sequence: Sequence, reader: FrameReader) -> dict[str, Any]:
    began, begin = time.time(), time.perf_counter()
    run, seconds = _tracked(job, sequence, reader)
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
        # without anybody tracked nothing is right, though the figures are not defined
        figures["score"] = ((hota or 0.0) + (idf1 or 0.0)) / 2.0
    overlap = None
    if job.agreement:
        looked = estimate(run)
        found = [one for one in looked.overlaps if one is not None]
        overlap = sum(found) / len(looked.overlaps) if looked.overlaps else None
        figures["identity"] = looked.score if len(run.tracks) else 0.0
    kept = None
    if job.keep:
        recording = recording_of(sequence, job.place, thumbnail_of(sequence, reader))
        kept = (
            recording,
            run_of(run, source="batch", began=began, seconds=took, evaluation=evaluation),
        )
    return {
        "figures": figures,
        "overlap": overlap,
        "tracks": tracks_hash(run),
        "people": len(set(run.tracks.ids.tolist())),
        "kept": kept,
    }


def _tracked(job: Job, sequence: Sequence, reader: FrameReader) -> tuple[Run, float | None]:
    """The run, and the seconds of processor time that it takes where nothing is kept.

    Stage 1 has threads of its own: what they take is the process's time less this thread's. Of a
    column that somebody else left without its time the seconds are None, unless they are asked
    for: then it is computed once more.
    """
    assert _process is not None
    parameters = with_values(pipeline.default_parameters(sequence), job.values)
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
        if cache is None:  # for the next trials
            pipeline.compute(
                sequence, parameters, seed=job.seed, corrections=job.corrections, previous=run,
                cache=_process.cache,
            )  # fmt: skip
    return run, None if known is None else known + own


def _read_seconds(key: str) -> float | None:
    try:
        return float((cache_folder() / "stage-seconds" / key).read_text(encoding="ascii"))
    except (OSError, ValueError):
        return None


def _write_seconds(key: str, seconds: float, run: Run) -> None:
    assert _process is not None
    known = _process.stage_seconds
    known[key] = seconds
    while len(known) > KNOWN_TIMES:
        known.popitem(last=False)
    if run.costly:  # it is on disk too, for other processes
        place = cache_folder() / "stage-seconds"
        try:
            place.mkdir(parents=True, exist_ok=True)
            (place / key).write_text(repr(seconds), encoding="ascii")
        except OSError:
            pass  # it is measured again


def tracks_hash(run: Run) -> str:
    """Of all columns of a run's tracks, bit for bit."""
    digest = hashlib.sha256()
    for name in ("frames", "ids", "positions", "existences", "sigmas", "seen"):
        digest.update(getattr(run.tracks, name).tobytes())
    return digest.hexdigest()[:24]
