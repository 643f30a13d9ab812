"""``tune``: better values for a recording in one step, measured again before they are told."""

from __future__ import annotations

import json
import sys
import time
from pathlib import Path

from app.command.arguments.studies import Tune
from app.command.commands.studies import INTERRUPTED, run, save_preset, shown_value
from app.command.flags import set_values
from app.command.terminal import print_table, say
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import ParameterError, with_values
from tracker.review.self_consistency.estimate import WARNING
from tracker.studies.errors import StudyError
from tracker.studies.store import create, studies_folder
from tracker.studies.tuning import tuning


def tune(command: Tune) -> int:
    """Seek, measure again, tell and keep; returns the exit status.

    Raises:
        StudyError: If a recording cannot be read, or the study cannot go on.
    """
    if not 0.0 < command.minutes <= 1e4:
        raise ParameterError("--minutes", f"expected a number above 0, got {command.minutes:g}")
    if not command.recordings:
        raise ParameterError("RECORDING …", "expected at least one recording")
    changes = set_values(command.set)
    with_values(RunParameters(), changes)  # wrong usage shows before any work
    name = f"tune {Path(command.recordings[0]).name} {time.strftime('%Y-%m-%d %H.%M.%S')}"
    definition = tuning(
        name,
        command.recordings,
        minutes=command.minutes,
        changes=changes,
        ignore_truth=command.without_truth,
    )
    blind = definition.objectives == ("identity",)
    if blind:
        say(f"no truth is looked at: the score without truth is what counts. {WARNING}")
    store = create(definition, command.studies or studies_folder())
    status = run(store, command, quiet=True)
    if status == INTERRUPTED:
        say(f"stopped; `multiview-phd study resume {name!r}` goes on")
        return status
    found = store.fact("tuned")
    if found is None:
        raise StudyError(f"study {name}: it ended before anything was measured again")
    if found["better"]:
        save_preset(
            command.save_as,
            {k: v for k, v in {**definition.held(), **found["values"]}.items()},
        )
    if command.json:
        told = {"study": name, "trials": len(store.trials()), **found}
        sys.stdout.write(json.dumps(told, allow_nan=False, ensure_ascii=False) + "\n")
        return 0
    say(f"{len(store.trials())} trials; {found['words']}")
    if found["rows"]:
        print_table(
            ("parameter", ">before", ">default", ">now", ">brings"),
            [
                (
                    row["key"], shown_value(row["before"]), shown_value(row["default"]),
                    shown_value(row["after"]),
                    "–" if row["brought"] is None else f"{row['brought']:+.4f}",
                )
                for row in found["rows"]
            ],
        )  # fmt: skip
    print_table(
        ("figure", ">default", ">before", ">now"),
        [
            (row["name"], *(shown_value(row[key]) for key in ("default", "before", "after")))
            for row in found["figures"]
        ],
    )
    return 0
