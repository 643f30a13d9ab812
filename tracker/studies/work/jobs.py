"""A job: one recording tracked with some values and one seed; and what became of it."""

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
"""Of what a job tells; another number computes all anew."""


@cache
def code_version() -> str:
    """Another text for every code that may tell other figures: what tracks, and what scores."""
    digest = hashlib.sha256(f"{FORMAT} {numbers_version('tracks')}".encode())
    for path in sorted(Path(evaluation.__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


@dataclass(frozen=True, slots=True)
class Job:
    """What a worker is sent. The same key is the same job, wherever it is done."""

    key: str
    """Hash of the recording's content, of the values that have an effect, of seed and code."""
    place: str
    """A rendered room's name, or a folder."""
    content: str
    """Hash of the recording's content."""
    values: Mapping[str, Any]
    """By key, against the recording's own defaults."""
    seed: int
    code: str
    truth: bool
    """Whether the run is scored against the truth."""
    agreement: bool
    """Whether it is held against other looks at the recording."""
    timed: bool
    """Whether what stage 1 takes must be known, be it from an earlier run."""
    keep: bool = False
    """Whether the whole run is wanted, for the library."""
    corrections: tuple[Correction, ...] = ()
    """What the run obeys of what was put right by hand."""


Became = Literal["done", "failed", "unreadable", "version"]
"""``unreadable``: the worker does not have the recording. ``version``: nor this program."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a job."""

    key: str
    became: Became
    words: str = ""
    """Why it is not done."""
    figures: Mapping[str, float | None] = field(default_factory=dict)
    """By the keys of the objectives."""
    overlap: float | None = None
    """Mean over cameras of the overlap of each camera's boxes with whom the others found."""
    tracks: str = ""
    """Hash of the tracks, bit for bit."""
    people: int = 0
    seconds: float = 0.0
    """On the clock of the worker, scoring included."""
    worker: str = ""
    machine: str = ""
    kept: tuple[NewRecording, NewRun] | None = None
    """The whole run, where it was wanted."""

    def to_json(self) -> dict[str, Any]:
        """As plain values, without the whole run."""
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
    """The job of a run.

    Args:
        sequence: The recording.
        place: What opens it.
        content: Hash of its content.
        parameters: All of them.
        values: The same against the recording's defaults.
        seed: Of the run.
        truth: Whether to score it against the truth.
        agreement: Whether to hold it against other looks.
        timed: Whether its speed is asked for.
        corrections: What it obeys of what was put right by hand.
    """
    own = replace(sequence, digest=content)
    run = stage_keys(own, parameters, seed, corrections)["tracks"]
    code = code_version()
    # whoever asks for the speed alone asks for no other run
    asked = [run, code, truth, agreement]
    key = hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:24]
    return Job(
        key, place, content, dict(values), seed, code, truth, agreement, timed,
        corrections=corrections,
    )  # fmt: skip
