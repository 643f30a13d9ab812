"""The common case in one step: the dozen parameters that matter most, on a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from tracker import parameters as table
from tracker.parameters import PARAMETERS, RunParameters, with_values
from tracker.runs.fitting import default_parameters
from tracker.sequences.errors import SequenceError
from tracker.sequences.library import open_sequence
from tracker.studies.defined.definition import MOST_TRIALS, Definition
from tracker.studies.defined.space import around
from tracker.studies.errors import StudyError

MORE = (
    "fusion.measurement_sigma",
    "fusion.occlusion",
    "fusion.start_velocity",
    "smoothing.doubt",
)
"""What is varied beside the essential parameters."""

PICTURES_MINUTES = 30.0
"""Parameters by which pictures are looked at again are varied from this time on: with less, one
look for all trials leaves more of them."""

OTHER_SEEDS = 3


def tuning(
    name: str,
    recordings: Sequence[str],
    *,
    minutes: float,
    changes: Mapping[str, Any],
    without_truth: bool = False,
) -> Definition:
    """The study that tunes recordings.

    Args:
        name: Of the study.
        recordings: Rooms and folders.
        minutes: How long it may take.
        changes: Where somebody is, by key against the recordings' defaults.
        without_truth: Whether truth is not looked at though it is there.

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
    truth = not without_truth and all(one.ground_truth is not None for one in opened)
    now = [with_values(default_parameters(one), changes) for one in opened]
    defaults = default_parameters(opened[0])
    keys = [key for key in table.shown_keys(now[0]) if _is_varied(key, now[0], minutes)]
    varied = [around(key, table.value(now[0], key), table.value(defaults, key)) for key in keys]
    own = table.changed(now[0], defaults)
    return Definition(
        name=name,
        recordings=tuple(_place(one) for one in recordings),
        varied=tuple(varied),
        trials=MOST_TRIALS,
        minutes=minutes,
        search="tpe",
        objectives=("score",) if truth else ("identity",),
        propose=OTHER_SEEDS,
        values={key: value for key, value in own.items() if key not in keys},
        start={key: value for key, value in own.items() if key in keys},
    )


def _place(name: str) -> str:
    return str(Path(name).absolute()) if Path(name).exists() else name


def _is_varied(key: str, now: RunParameters, minutes: float) -> bool:
    if key not in PARAMETERS or not (PARAMETERS[key].essential or key in MORE):
        return False
    looks = now.method("single_view").used(now).pictures
    at_pictures = PARAMETERS[key].stage == "single_view" and looks
    return not at_pictures or minutes >= PICTURES_MINUTES
