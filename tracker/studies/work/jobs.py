"""A job, which is one recording tracked with certain parameters and a seed, and its outcome."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cache
from pathlib import Path
from typing import Any, Literal

from tracker import evaluation
from tracker.corrections import Correction
from tracker.library.records import NewRecording, NewRun
from tracker.parameters import RunParameters
from tracker.runs.numbers_version import numbers_version
from tracker.runs.run import stage_keys
from tracker.sequences.sequence import Sequence

FORMAT = 1
"""Version of the outcomes; with another number all jobs are computed again."""


@cache
def code_version() -> str:
    """Return a text that differs for every version of the code that may change a figure."""
    digest = hashlib.sha256(f"{FORMAT} {numbers_version('tracks')}".encode())
    for path in sorted(Path(evaluation.__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Job:
    """A job for a worker. Jobs with the same key have the same outcome on every machine."""

    key: str
    """The hash of the recording's content, the parameters that have an effect, seed and code."""
    place: str
    """The name or folder by which the recording is opened."""
    content: str
    """The hash of the recording's content."""
    values: Mapping[str, Any]
    """The values by key that differ from the recording's defaults."""
    seed: int
    code: str
    """The version of the code, see :func:`code_version`."""
    truth: bool
    """Whether the run is evaluated against ground truth."""
    agreement: bool
    """Whether the run is compared with its variants (self-consistency)."""
    timed: bool
    """Whether the time of stage 1 must be known, if only from an earlier run."""
    keep: bool = False
    """Whether the outcome has the run's tracks, for the library."""
    corrections: tuple[Correction, ...] = ()
    """The corrections that the run applies."""


Became = Literal["done", "failed", "unreadable", "version"]
"""The state of an outcome: ``unreadable`` if the worker cannot read the recording, ``version`` if
it has another version of the program."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a job."""

    key: str
    became: Became
    words: str = ""
    """The reason why the job is not done."""
    figures: Mapping[str, float | None] = field(default_factory=dict)
    """The figures, by the keys of the objectives."""
    overlap: float | None = None
    """Overlap of each camera's boxes with the tracks of the run without it, mean over cameras."""
    tracks: str = ""
    """The hash of the tracks."""
    people: int = 0
    """The number of tracks."""
    seconds: float = 0.0
    """The duration on the worker's clock, with the evaluation, seconds."""
    worker: str = ""
    machine: str = ""
    kept: tuple[NewRecording, NewRun] | None = None
    """The records for the library, if they were wanted."""

    def to_json(self) -> dict[str, Any]:
        """Return all fields but ``kept`` as plain values."""
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name != "kept"}


def job_of(
    sequence: Sequence,
    place: str,
    content: str,
    parameters: RunParameters,
    values: Mapping[str, Any],
    seed: int,
    *,
    truth: bool,
    agreement: bool,
    timed: bool,
    corrections: tuple[Correction, ...] = (),
) -> Job:
    """Return the job of a run.

    Args:
        sequence: The recording.
        place: The name or folder by which the recording is opened.
        content: The hash of its content.
        parameters: All parameters of the run.
        values: Those that differ from the recording's defaults, by key.
        seed: The seed of the run.
        truth: Whether to evaluate the run against ground truth.
        agreement: Whether to compare the run with its variants.
        timed: Whether its speed must be known.
        corrections: The corrections that the run applies.
    """
    own = replace(sequence, digest=content)
    run = stage_keys(own, parameters, seed, corrections)["tracks"]
    code = code_version()
    # ``timed`` is left out, since it does not change the run
    asked = [run, code, truth, agreement]
    key = hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:24]
    return Job(
        key, place, content, dict(values), seed, code, truth, agreement, timed,
        corrections=corrections,
    )  # fmt: skip
