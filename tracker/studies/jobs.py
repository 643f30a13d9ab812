"""Jobs, each of which tracks one recording with certain parameters and a seed, and their
outcomes."""

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
from tracker.parameters.catalogue import RunParameters
from tracker.runs.numbers_version import numbers_version
from tracker.runs.run import stage_keys
from tracker.sequences.sequence import Sequence

FORMAT = 1
"""Version of the outcomes; if it changes, all jobs are computed again."""

_TRACKER = Path(evaluation.__file__).parents[1]

FIGURES = ("evaluation", "review/self_consistency")
"""The packages that compute the figures of a run from its tracks."""


@cache
def figures_version(tracker: Path = _TRACKER) -> str:
    """Return a hash of the code that may change a figure of a run.

    It covers the code of the tracks and that of the figures, without the reports on them.

    Args:
        tracker: The folder of the package whose code of the figures is read.
    """
    digest = hashlib.sha256(f"{FORMAT} {numbers_version('tracks')}".encode())
    for package in FIGURES:
        for path in sorted((tracker / package).rglob("*.py")):
            name = path.relative_to(tracker).as_posix()
            if not name.startswith("evaluation/report"):
                digest.update(name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Job:
    """A job for a worker; jobs with the same key have the same outcome on every machine."""

    key: str
    """The hash of the recording's content, the parameters that have an effect, the seed, the
    corrections, the code and the wanted figures."""
    place: str
    """The name or folder by which the recording is opened."""
    content: str
    """The hash of the recording's content."""
    values: Mapping[str, Any]
    """The values by key that differ from the recording's defaults."""
    seed: int
    """The seed of the random numbers."""
    code: str
    """The version of the code, see :func:`figures_version`."""
    truth: bool
    """Whether the run is evaluated against ground truth."""
    agreement: bool
    """Whether the run is compared with its variants (self-consistency)."""
    timed: bool
    """Whether the time of stage 1 must be measured, unless it is known from an earlier run."""
    keep: bool = False
    """Whether the outcome includes the records for the library, with the tracks."""
    corrections: tuple[Correction, ...] = ()
    """The corrections that the run applies."""


Became = Literal["done", "failed", "unreadable", "version"]
"""The state of a job: ``unreadable`` if the worker cannot read the recording, ``version`` if the
worker has another version of the program."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a job."""

    key: str
    """The key of the job."""
    became: Became
    """The state of the job."""
    words: str = ""
    """The reason if the job was not done; empty if it was."""
    figures: Mapping[str, float | None] = field(default_factory=dict)
    """The figures, by the keys of the objectives."""
    overlap: float | None = None
    """The mean over cameras of the overlap of a camera's boxes with the tracks of the run without
    this camera, 0 … 1; None if it was not computed."""
    tracks: str = ""
    """The hash of the tracks."""
    people: int = 0
    """The number of tracks."""
    seconds: float = 0.0
    """The duration of the job on the worker's clock, including the evaluation, seconds."""
    worker: str = ""
    """The name of the worker."""
    machine: str = ""
    """The name of the worker's machine."""
    kept: Any = None
    """The records for the library, a :class:`~tracker.library.records.NewRecording` and a
    :class:`~tracker.library.records.NewRun`; None if the job did not ask for them."""

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
    keep: bool = False,
    corrections: tuple[Correction, ...] = (),
) -> Job:
    """Return the job of a run.

    Args:
        sequence: The recording.
        place: The name or folder by which the recording is opened.
        content: The hash of the recording's content.
        parameters: All parameters of the run.
        values: The values by key that differ from the recording's defaults.
        seed: The seed of the run.
        truth: Whether to evaluate the run against ground truth.
        agreement: Whether to compare the run with its variants.
        timed: Whether the time of stage 1 must be known.
        keep: Whether the outcome includes the records for the library.
        corrections: The corrections that the run applies.
    """
    own = replace(sequence, digest=content)
    run = stage_keys(own, parameters, seed, corrections)["tracks"]
    code = figures_version()
    # ``timed`` is left out, since it does not change the run
    asked = [run, code, truth, agreement]
    key = hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:24]
    return Job(
        key, place, content, dict(values), seed, code, truth, agreement, timed, keep, corrections
    )  # fmt: skip
