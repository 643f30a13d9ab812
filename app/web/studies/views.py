"""Studies as the messages of :mod:`app.web.studies.models`."""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

from app.state.snapshot import Snapshot
from app.state.studies import StudyDesk
from app.web.studies import models
from tracker.parameters.catalogue import METHODS, PARAMETERS
from tracker.parameters.values import shown_keys, value_of, with_values
from tracker.studies.objectives import Objective
from tracker.studies.space import Varied, around
from tracker.studies.store import Store, Trial

_METHOD_HELP = {
    "single_view": "Method of stage 1.",
    "fusion_method": "Method of stage 2.",
    "smoothing_method": "Method of stage 3.",
}


def study_of(desk: StudyDesk, store: Store) -> models.Study:
    """A study but its trials."""
    summary, status = desk.summary(store), store.status()
    defaults = summary.defaults
    return models.Study(
        info=models.StudyInfo(**desk.info(store)),
        definition=summary.definition.to_json(),
        toml=summary.definition.to_toml(),
        objectives=[objective_of(one) for one in summary.objectives],
        beside=[objective_of(one) for one in summary.beside],
        varied=[
            range_of(one, defaults.get(one.key), summary.definition.start.get(one.key))
            for one in summary.definition.varied
        ],
        status=models.StudyStatus(
            runs=max(status.all_runs, status.runs),  # an older status has those of a start alone
            seconds=max(status.all_seconds, status.seconds),
            seconds_left=status.seconds_left,
            busy=status.busy,
            workers=[models.WorkerInfo(**one) for one in status.workers],
        ),
        best=None if summary.best is None else summary.best.number,
        front=summary.front,
        importance=[
            models.ImportanceInfo(key=key, share=share, spread=spread)
            for key, (share, spread) in summary.importance
        ],
        importance_trials=summary.importance_trials,
        sentences=summary.sentences(),
    )


def objective_of(one: Objective) -> models.ObjectiveInfo:
    """A figure that trials are judged by."""
    return models.ObjectiveInfo(
        key=one.key,
        name=one.name,
        help=one.help,
        higher=one.higher,
        unit=one.unit,
        digits=one.digits,
        of=one.of,
    )


def range_of(one: Varied, default: Any, now: Any) -> models.RangeInfo:
    """A varied parameter."""
    parameter = PARAMETERS.get(one.key)
    own = default if default is not None or parameter is None else parameter.default
    return models.RangeInfo(
        key=one.key,
        label=one.key.replace("_", " ").capitalize() if parameter is None else parameter.label,
        symbol="" if parameter is None else parameter.symbol,
        unit="" if parameter is None else parameter.unit,
        help=_METHOD_HELP.get(one.key, "") if parameter is None else parameter.help,
        kind="choice" if parameter is None else parameter.kind,
        minimum=None if parameter is None else parameter.minimum,
        maximum=None if parameter is None else parameter.maximum,
        low=one.low,
        high=one.high,
        log=one.log,
        choices=list(one.choices),
        default=own,
        now=own if now is None else now,
    )


def trial_of(trial: Trial) -> models.TrialInfo:
    """A trial that ended."""
    told = asdict(trial)
    del told["jobs"], told["missing_overlap"]
    return models.TrialInfo(**told)


def tuned_of(found: dict[str, Any] | None) -> models.Tuned:
    """What a study proposes; None where it has not come to its end."""
    if found is None:
        return models.Tuned(
            done=False, better=False, words="", trial=None, seeds=[], rows=[], figures=[]
        )
    rows = []
    for row in found["rows"]:
        parameter = PARAMETERS.get(row["key"])
        symbol = "" if parameter is None else parameter.symbol
        unit = "" if parameter is None else parameter.unit
        rows.append(models.TunedRow(symbol=symbol, unit=unit, **row))
    return models.Tuned(
        done=True,
        better=found["better"],
        words=found["words"],
        trial=found["trial"],
        seeds=found["seeds"],
        rows=rows,
        figures=[models.TunedFigure(**one) for one in found["figures"]],
    )


def ranges_of(snapshot: Snapshot, keys: list[str] | None) -> list[models.RangeInfo]:
    """Ranges around today's values.

    Args:
        snapshot: Of the workbench.
        keys: Which parameters; None for the essential ones that have an effect.

    Raises:
        ParameterError: If there is none of a key.
    """
    now, defaults = snapshot.parameters, snapshot.defaults
    if keys is None:
        keys = [key for key in shown_keys(now) if key in PARAMETERS and PARAMETERS[key].essential]
    found = []
    for key in keys:
        if key not in PARAMETERS and key not in METHODS:
            with_values(now, {key: None})  # says what is wrong
        own, default = value_of(now, key), value_of(defaults, key)
        if key == "single_view":
            fit = [
                one for one in METHODS["single_view"] if one not in snapshot.unfit["single_view"]
            ]
            one = Varied(key, choices=tuple(fit))
        else:
            one = around(key, own, default)
        found.append(range_of(one, default, own))
    return found
