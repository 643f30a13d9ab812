"""The commands that reproduce the runs of a trial exactly."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

from tracker.parameters.values import changed_values, with_values
from tracker.runs import pipeline
from tracker.sequences.library import open_sequence
from tracker.studies.definition.definition import Definition
from tracker.studies.storage.records import JobRow, Trial


def track_commands(definition: Definition, trial: Trial) -> list[str]:
    """Return the ``track`` command of each run of a trial.

    Args:
        definition: The definition of the study.
        trial: The trial.

    Raises:
        SequenceError: If a recording cannot be read.
    """
    return [_command(definition, trial, row) for row in trial.jobs]


def changes_of(definition: Definition, trial: Trial, recording: str) -> dict[str, Any]:
    """Return the values of a trial that differ from the recording's defaults, by key.

    Args:
        definition: The definition of the study.
        trial: The trial.
        recording: The name or folder of the recording.
    """
    defaults = pipeline.default_parameters(open_sequence(recording))
    values = trial.values if trial.number else {}
    return changed_values(with_values(defaults, {**definition.held(), **values}), defaults)


def _command(definition: Definition, trial: Trial, row: JobRow) -> str:
    """Return the ``track`` command of one run of a trial."""
    words = ["multiview-phd", "track", row.recording, "--no-corrections", "--seed", str(row.seed)]
    for key, value in changes_of(definition, trial, row.recording).items():
        text = json.dumps(value) if not isinstance(value, str) else value
        words += ["--set", f"{key}={text}"]
    name = f"{definition.name} trial {trial.number} {Path(row.recording).name} seed {row.seed}"
    return shlex.join([*words, "--output", f"{name.replace(' ', '-')}.csv"])
