"""Tuning: a study of the most important parameters on given recordings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import changed_values, shown_keys, value_of, with_values
from tracker.runs.fitting import default_parameters
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import open_sequence
from tracker.studies.definition import MOST_TRIALS, StudyDefinition, places_of
from tracker.studies.errors import StudyError
from tracker.studies.space import around

MORE = (
    "fusion.measurement_sigma",
    "fusion.occlusion",
    "smoothing.ambiguity_threshold",
)
"""Keys of parameters that are varied besides the essential ones."""

PICTURES_MINUTES = 30.0
"""Least duration, minutes, of a study that varies parameters of stage 1 if this processes pictures.
In a shorter study stage 1 is computed once for all trials, so that there are more trials."""

OTHER_SEEDS = 3
"""The number of further seeds on which the best trials are evaluated again."""


def tuning(
    name: str,
    recordings: Sequence[str],
    *,
    minutes: float,
    changes: Mapping[str, Any],
    ignore_truth: bool = False,
) -> StudyDefinition:
    """Return the definition of a study that tunes the parameters for recordings.

    Args:
        name: The name of the study.
        recordings: Names of built-in recordings, and folders.
        minutes: The duration of the study, minutes.
        changes: The user's current values by key that differ from the recordings' defaults.
        ignore_truth: Whether the objective does not use ground truth even if all recordings have
            it.

    Raises:
        StudyError: If a recording cannot be read.
    """
    opened = []
    for place in recordings:
        try:
            opened.append(open_sequence(place))
        except (SequenceError, OSError) as error:
            words = " ".join(str(error).split())
            raise StudyError(f"{place} cannot be read: {words}") from None
    truth = not ignore_truth and all(one.ground_truth is not None for one in opened)
    now = [with_values(default_parameters(one), changes) for one in opened]
    defaults = default_parameters(opened[0])
    keys = [key for key in shown_keys(now[0]) if _is_varied(key, now[0], minutes)]
    varied = [around(key, value_of(now[0], key), value_of(defaults, key)) for key in keys]
    own = changed_values(now[0], defaults)
    return StudyDefinition(
        name=name,
        recordings=tuple(places_of(recordings, Path.cwd())),
        varied=tuple(varied),
        trials=MOST_TRIALS,
        minutes=minutes,
        search="tpe",
        objectives=("score",) if truth else ("identity",),
        propose=OTHER_SEEDS,
        values={key: value for key, value in own.items() if key not in keys},
        start={key: value for key, value in own.items() if key in keys},
    )


def _is_varied(key: str, now: RunParameters, minutes: float) -> bool:
    """Whether a parameter is varied in a study with a duration in minutes."""
    if key not in PARAMETERS or not (PARAMETERS[key].essential or key in MORE):
        return False
    pictures = now.method("single_view").used(now).pictures
    on_pictures = PARAMETERS[key].stage == "single_view" and pictures
    return not on_pictures or minutes >= PICTURES_MINUTES
