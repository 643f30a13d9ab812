"""The worth of stage 1's parameters: each at both ends of a range, in random rooms.

``python -m tests.papers.rooms.ablations -o FOLDER`` renders the rooms, runs what no earlier start
ran, one row a run, and writes the table. A parameter counts as flat where no value of it changes
any figure's mean over the rooms by as much as :data:`LEAST`.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from tests.papers.rooms.kept import Rows, keep_row, read_rows
from tests.rooms import render_random
from tests.rooms.random_rooms import VERSION
from tracker.evaluation import evaluate_sequence
from tracker.parameters import Stage
from tracker.parameters.catalogue import PARAMETERS, RunParameters, method_of
from tracker.parameters.values import shown_keys, value_of, with_values
from tracker.runs import pipeline
from tracker.runs.numbers_version import method_version, numbers_version
from tracker.sequences.pictures.frames import FrameReader
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

FIGURES = ("found_share", "false_per_step", "idf1")
LEAST = 0.005
"""Change of a figure's mean over the rooms from which a parameter has an effect."""
FACTOR = 2.0
"""Both ends of a number's range: its default times and over this, within its bounds."""
METHODS = {
    "colour_phd": "templates",
    "shapes": "pictures",
    "jpda": "pictures",
    "pseudo_particle": "templates",
    "association_matrix": "pictures",
    "detection_phd": "detections",
    "none": "detections",
}
"""The methods that are judged, and what they are given beside videos and calibration: templates
of the people, the boxes of a detector, or nothing."""
TABLE = Path(__file__).with_name("ablations.md")


@dataclass(frozen=True, slots=True)
class Trial:
    """A method with one parameter changed; with none, what all others are compared with."""

    method: str
    """Name of the single-view method."""
    key: str = ""
    """Key of the changed parameter."""
    value: Any = None
    """The value of that parameter."""

    @property
    def parameters(self) -> RunParameters:
        """The defaults with both changes."""
        changes = {self.key: self.value} if self.key else {}
        return with_values(RunParameters(), {"single_view": self.method, **changes})

    def row_key(self, steps: int) -> str:
        """The key of a row: code, values and number of steps."""
        return row_key(self.method, self.parameters, METHODS[self.method], steps)


def row_key(method: str, parameters: RunParameters, *more: Any) -> str:
    """The key of a row: the code of all stages, values, and what else a run depends on."""
    parts = [_code(method), parameters.model_dump(mode="json"), *more]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


@cache
def _code(method: str) -> tuple[Any, ...]:
    """The versions of the code on which the rows of a single-view method depend."""
    stages: tuple[Stage, ...] = ("single_view", "fusion", "smoothing", "tracks")
    own = method_version(method_of("single_view", method))
    return (VERSION, [numbers_version(stage) for stage in stages], own)


def is_free(key: str) -> bool:
    """Whether a parameter may go: one without a published value that is not essential."""
    return PARAMETERS[key].published is None and not PARAMETERS[key].essential


def judged(method: str) -> tuple[str, ...]:
    """The parameters of stage 1 that a method reads, less published and essential ones."""
    defaults = Trial(method).parameters
    return tuple(
        key
        for key in shown_keys(defaults)
        if key in PARAMETERS and PARAMETERS[key].stage == "single_view" and is_free(key)
    )


def ends(key: str) -> tuple[Any, ...]:
    """The other values at which a parameter is judged.

    A number is halved and doubled; one of both signs moves by half its size to either side, or by a
    tenth of its range from 0. A probability above 1/2 halves and doubles its distance from 1.
    """
    parameter, default = PARAMETERS[key], value_of(RunParameters(), key)
    if parameter.kind == "bool":
        return (not default,)
    if parameter.kind == "choice":
        without = {default, "detections"}  # the methods on pictures are given no boxes
        return tuple(one for one in parameter.choices if one not in without)
    low, high = float(parameter.minimum or 0.0), float(parameter.maximum or 0.0)
    if high <= 1.0 and default > 0.5:
        both = [1.0 - (1.0 - default) * FACTOR, 1.0 - (1.0 - default) / FACTOR]
    elif low < 0.0:
        move = abs(default) / FACTOR or 0.1 * (high - low)
        both = [default - move, default + move]
    else:
        both = [default / FACTOR, default * FACTOR] if default else [0.1 * high]
    values = [float(np.clip(one, low, high)) for one in both]
    if parameter.kind == "int":
        values = [round(one) for one in values]
    return tuple(dict.fromkeys(one for one in values if one != default))


def trials(methods: tuple[str, ...]) -> Iterator[Trial]:
    """The comparison of each method, then every value of every parameter that is judged."""
    for method in methods:
        yield Trial(method)
        for key in judged(method):
            yield from (Trial(method, key, value) for value in ends(key))


def measure(sequence: Sequence, reader: FrameReader, trial: Trial, steps: int) -> dict[str, Any]:
    """Run one trial in one room: the figures of its tracks, and a hash of their numbers."""
    run = pipeline.compute(sequence, trial.parameters, seed=0, steps=steps, reader=reader)
    evaluation = evaluate_sequence(sequence, run.tracks, steps=run.done)
    figures = {figure: evaluation[figure] for figure in FIGURES}
    numbers = (run.tracks.frames, run.tracks.ids, run.tracks.positions, run.tracks.sigmas)
    digest = hashlib.sha256(b"".join(np.ascontiguousarray(one).tobytes() for one in numbers))
    return {**figures, "tracks": digest.hexdigest()[:16]}


def _given(whole: Sequence) -> dict[str, Sequence]:
    """A room with its templates, with its pictures alone, and with the boxes of a detector."""
    views = tuple(replace(view, detections=None) for view in whole.views)
    templates = replace(whole, views=views, digest=f"{whole.digest}-without-boxes")
    bare = replace(templates, templates=(), digest=f"{whole.digest}-without-templates")
    return {"templates": templates, "pictures": bare, "detections": whole}


def fill(rows: Rows, seeds: range, steps: int, methods: tuple[str, ...], folder: Path) -> None:
    """Run what has no row yet; every row is written as soon as it is there."""
    for seed in seeds:
        missing = [t for t in trials(methods) if (seed, t.row_key(steps)) not in rows]
        if not missing:
            continue
        room = folder / f"{seed}"
        if not (room / "sequence.toml").is_file():
            render_random(seed, room, detections=True, frames=steps)
        for given, sequence in _given(read_sequence(room)).items():
            if given == "templates" and not sequence.templates:
                continue  # nobody of this room stands free in these steps
            with FrameReader(sequence) as reader:
                for trial in missing:
                    if METHODS[trial.method] != given:
                        continue
                    row = {"seed": seed, "key": trial.row_key(steps), "method": trial.method,
                           "parameter": trial.key, "value": trial.value}  # fmt: skip
                    row |= measure(sequence, reader, trial, min(steps, sequence.frames))
                    keep_row(folder, row)
                    rows[seed, row["key"]] = row


def effects(rows: Rows, seeds: range, steps: int, methods: tuple[str, ...]) -> list[dict[str, Any]]:
    """The largest change of each figure's mean over the rooms, by parameter.

    Rooms in which the comparison or any value has no row are left out.
    """
    found = []
    for method in methods:
        usual = Trial(method).row_key(steps)
        for key in judged(method):
            own = {value: Trial(method, key, value).row_key(steps) for value in ends(key)}
            there = [s for s in seeds if all((s, k) in rows for k in (usual, *own.values()))]
            changes = {
                value: [
                    np.mean([(rows[s, k][f] or 0.0) - (rows[s, usual][f] or 0.0) for s in there])
                    for f in FIGURES
                ]
                for value, k in own.items()
                if there
            }
            most = np.abs(list(changes.values())).max(axis=0) if changes else np.full(3, np.nan)
            found.append(
                {"method": method, "parameter": key, "rooms": len(there), "changes": changes,
                 "flat": bool(there) and bool((most < LEAST).all()),
                 "same": bool(there) and all(
                     rows[s, k].get("tracks", k) == rows[s, usual].get("tracks")
                     for s in there for k in own.values()
                 )}
            )  # fmt: skip
    return found


def table(found: list[Mapping[str, Any]], seeds: range, steps: int) -> str:
    """The effects as a Markdown table."""
    methods = dict.fromkeys(one["method"] for one in found)
    lines = [
        "# Stage 1: what each parameter changes in random rooms",
        "",
        f"Rooms {seeds.start} to {seeds.stop - 1}, {steps} steps, seed 0: change of the means of "
        "recall, false positives a step and IDF1 against the defaults. Published and essential "
        f"parameters are not judged. *flat*: every change is below {LEAST:g}; *same*: every number "
        "of the tracks is as without the change. A parameter that no longer exists was judged "
        "before it went. Made by `python -m tests.papers.rooms.ablations -o FOLDER --first "
        f"{seeds.start} --count {len(seeds)} --steps {steps}"
        f"{''.join(f' --method {name}' for name in methods)}`.",
        "",
        "| method | parameter | value | rooms | recall | false | IDF1 | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for one in found:
        for value, changes in one["changes"].items():
            cells = " | ".join(f"{change:+.3f}" for change in changes)
            shown = f"{value:g}" if isinstance(value, float) else value
            flat = "same" if one["same"] else "flat" if one["flat"] else ""
            lines.append(
                f"| {one['method']} | {one['parameter']} | {shown} | {one['rooms']} "
                f"| {cells} | {flat} |"
            )
    return "\n".join(lines) + "\n"


def common_arguments(module: str, table: Path, first: int) -> argparse.ArgumentParser:
    """The arguments that the studies of parameters share."""
    parser = argparse.ArgumentParser(prog=f"python -m tests.papers.rooms.{module}")
    parser.add_argument("-o", "--output", type=Path, required=True, help="rows and rooms")
    parser.add_argument("--table", type=Path, default=table, help="the Markdown file")
    parser.add_argument("--first", type=int, default=first, help="seed of the first room")
    parser.add_argument("--count", type=int, default=6, help="number of rooms for all")
    parser.add_argument("--steps", type=int, default=100)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Measure what is missing and write the table; returns the exit status."""
    parser = common_arguments("ablations", TABLE, 401)
    parser.add_argument("--method", action="append", choices=list(METHODS), help="repeatable")
    given = parser.parse_args(arguments)
    seeds, methods = range(given.first, given.first + given.count), tuple(given.method or METHODS)
    rows = read_rows(given.output)
    fill(rows, seeds, given.steps, methods, given.output)
    given.table.write_text(
        table(effects(rows, seeds, given.steps, methods), seeds, given.steps), encoding="utf-8"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
