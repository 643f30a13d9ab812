"""The worth of stage 1's parameters: each at both ends of a range, in random rooms.

``python -m tests.papers.rooms.ablations -o FOLDER`` renders the rooms, runs what no earlier start
ran, one row a run, and writes the table. A parameter acts where a value of it changes the mean of
a figure over the rooms by :data:`LEAST` or more, and does so in :data:`ALIKE` rooms. The first
:data:`ROOMS_FOR_ALL` rooms are for every parameter, further ones for those that do not act in them.
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
"""Change of the mean of a figure from which a parameter acts."""
ALIKE = 2
"""Number of rooms in which the figure must change by that in the direction of the mean: by chance a
single track of a single room comes or goes, and with it the mean, whichever parameter changed."""
ROOMS_FOR_ALL = 6
"""Number of rooms in which every parameter is run; the others are for those that do not act yet."""
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
    """The parameters of stage 1 that a method reads and that may go, and its switches and choices:
    what these choose is a mechanism, whose worth is judged whether or not it is published."""
    keys = [key for key in shown_keys(Trial(method).parameters) if key in PARAMETERS]
    return tuple(
        key
        for key in keys
        if PARAMETERS[key].stage == "single_view"
        and (is_free(key) or PARAMETERS[key].kind in ("bool", "choice"))
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


def _given(whole: Sequence, given: str) -> Sequence:
    """A room with its templates, with its pictures alone, or with the boxes of a detector."""
    if given == "detections":
        return whole
    views = tuple(replace(view, detections=None) for view in whole.views)
    templates = replace(whole, views=views, digest=f"{whole.digest}-without-boxes")
    if given == "templates":
        return templates
    return replace(templates, templates=(), digest=f"{whole.digest}-without-templates")


def fill(
    rows: Rows, seeds: tuple[int, ...], steps: int, methods: tuple[str, ...], folder: Path
) -> None:
    """Run what has no row yet, method by method; every row is written as soon as it is there."""
    first, further = seeds[:ROOMS_FOR_ALL], seeds[ROOMS_FOR_ALL:]
    for method in methods:
        for seed in (*first, *further):
            acting = set()
            if seed in further:
                found = effects(rows, first, steps, (method,))
                acting = {one["parameter"] for one in found if one["acts"]}
            missing = [
                trial
                for trial in trials((method,))
                if trial.key not in acting and (seed, trial.row_key(steps)) not in rows
            ]
            if missing:
                _fill_room(rows, seed, steps, missing, folder)


def _fill_room(rows: Rows, seed: int, steps: int, missing: list[Trial], folder: Path) -> None:
    """Run trials of one method in one room."""
    method, room = missing[0].method, folder / f"{seed}"
    if not (room / "sequence.toml").is_file():
        render_random(seed, room, detections=True, frames=steps)
    sequence = _given(read_sequence(room), METHODS[method])
    if METHODS[method] == "templates" and not sequence.templates:
        return  # nobody of this room stands free in these steps
    with FrameReader(sequence) as reader:
        for trial in missing:
            row = {"seed": seed, "key": trial.row_key(steps), "method": method,
                   "parameter": trial.key, "value": trial.value}  # fmt: skip
            row |= measure(sequence, reader, trial, min(steps, sequence.frames))
            keep_row(folder, row)
            rows[seed, row["key"]] = row


def effects(
    rows: Rows, seeds: tuple[int, ...], steps: int, methods: tuple[str, ...]
) -> list[dict[str, Any]]:
    """The change of each figure's mean over the rooms by parameter and value, and what it means.

    Rooms in which the comparison or any value has no row are left out.
    """
    found = []
    for method in methods:
        usual = Trial(method).row_key(steps)
        for key in judged(method):
            own = {value: Trial(method, key, value).row_key(steps) for value in ends(key)}
            there = [s for s in seeds if all((s, k) in rows for k in (usual, *own.values()))]
            changes = np.array(
                [
                    [[(rows[s, k][f] or 0.0) - (rows[s, usual][f] or 0.0) for f in FIGURES]
                     for k in own.values()]
                    for s in there
                ]
            ).reshape(len(there), len(own), len(FIGURES))  # fmt: skip
            means = changes.mean(axis=0) if there else np.zeros(changes.shape[1:])
            alike = (np.sign(means) * changes >= LEAST).sum(axis=0) >= ALIKE
            acts = bool((alike & (np.abs(means) >= LEAST)).any())
            found.append(
                {"method": method, "parameter": key, "rooms": tuple(there),
                 "changes": dict(zip(own, means, strict=True)) if there else {},
                 "acts": acts,
                 "flat": bool(there) and not acts,
                 "same": bool(there) and all(
                     rows[s, k].get("tracks", k) == rows[s, usual].get("tracks")
                     for s in there for k in own.values()
                 )}
            )  # fmt: skip
    return found


def table(found: list[Mapping[str, Any]], steps: int, earlier: str = "") -> str:
    """The effects as a Markdown table, after the lines of what was measured earlier alone.

    Args:
        found: The effects of this run.
        steps: Number of steps of each room.
        earlier: The table as it was.
    """
    lines = [
        "# Stage 1: what each parameter changes in random rooms",
        "",
        f"{steps} steps of random rooms, seed 0: change of the means of recall, false positives a "
        "step and IDF1 against the defaults. No published and no essential number is judged. "
        f"*acts*: the mean of a figure changes by {LEAST:g} or more, and does in {ALIKE} rooms at "
        f"least; where it does in the first {ROOMS_FOR_ALL}, no further one was run. *flat*: none "
        "does; *same*: every number of the tracks is as without the change. A parameter that no "
        "longer exists was judged before it went, in rows of four rooms and fewer by the change "
        "in any one of them. Made by `python -m tests.papers.rooms.ablations`.",
        "",
        "| method | parameter | value | rooms | recall | false | IDF1 | |",
        "|---|---|---|---|---|---|---|---|",
    ]
    measured = {(one["method"], one["parameter"], tuple(one["rooms"])) for one in found}
    for line in earlier.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        if len(cells) == len(lines[-1].split("|")) and "." in cells[2]:
            if (cells[1], cells[2], tuple(map(int, cells[4].split()))) not in measured:
                lines.append(line)
    for one in found:
        rooms = " ".join(map(str, one["rooms"]))
        for value, changes in one["changes"].items():
            cells = [f"{change:+.3f}" for change in changes]
            shown = f"{value:g}" if isinstance(value, float) else f"{value}"
            flat = "same" if one["same"] else "flat" if one["flat"] else "acts"
            row = [one["method"], one["parameter"], shown, rooms, *cells, flat]
            lines.append(f"| {' | '.join(row)} |")
    return "\n".join(lines) + "\n"


def common_arguments(module: str, table: Path, seeds: range) -> argparse.ArgumentParser:
    """The arguments that the studies of parameters share."""
    parser = argparse.ArgumentParser(prog=f"python -m tests.papers.rooms.{module}")
    parser.add_argument("-o", "--output", type=Path, required=True, help="rows and rooms")
    parser.add_argument("--table", type=Path, default=table, help="the Markdown file")
    parser.add_argument("--seeds", type=int, nargs="+", default=seeds, help="of the rooms for all")
    parser.add_argument("--steps", type=int, default=100)
    return parser


def main(arguments: list[str] | None = None) -> int:
    """Measure what is missing and write the table; returns the exit status."""
    parser = common_arguments("ablations", TABLE, range(401, 407))
    parser.add_argument("--method", action="append", choices=list(METHODS), help="repeatable")
    given = parser.parse_args(arguments)
    seeds, methods = tuple(given.seeds), tuple(given.method or METHODS)
    rows = read_rows(given.output)
    fill(rows, seeds, given.steps, methods, given.output)
    earlier = given.table.read_text(encoding="utf-8") if given.table.is_file() else ""
    found = effects(rows, seeds, given.steps, methods)
    given.table.write_text(table(found, given.steps, earlier), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
