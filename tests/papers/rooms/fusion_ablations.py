"""The worth of the parameters of fusion and smoothing: each at both ends of a range.

``python -m tests.papers.rooms.fusion_ablations -o FOLDER`` renders random rooms with a detector's
boxes, tracks in them and in pieces of recordings what no earlier start tracked, one row a run, and
writes the table. What is flat in the first rooms is judged in more. A parameter counts as flat
where no value of it changes the mean of any figure, over the rooms, over random crowds or over the
recordings, by as much as :data:`~tests.papers.rooms.ablations.LEAST`, with either filter.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.conftest import DATA
from tests.papers.rooms.ablations import LEAST, common_arguments, ends, is_free, row_key
from tests.papers.rooms.kept import Rows, keep_row, read_rows
from tests.random_rooms import random_room
from tests.rooms import render_random
from tracker.evaluation import evaluate_sequence
from tracker.parameters.catalogue import PARAMETERS, RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.run import Run
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

RECORDINGS = {
    "cmc1": 200, "cmc2": 200, "cmc2-looks": 200, "av163-seq45-3p-1111-points": 200,
    "wildtrack-points-300": 100,
}  # fmt: skip
"""Recordings of a detector's boxes, and the number of steps from the beginning."""

CROWDS = {f"crowd {seed}": seed for seed in range(911, 915)}
"""Random crowds of ten people before three cameras at 4 steps/s, by their seeds: rules of identity
are made for them."""

CROWD_STEPS = 160

TWO_CAMERAS = "cmc2-looks"
"""The recording of which two cameras are tracked: with more, appearance has nothing to decide."""

FIGURES = ("found_share", "false_share", "idf1")
"""Recall, false positives by true position, and IDF1."""

FILTERS = ("multi_bernoulli", "sequential_phd")

CONDITIONS: dict[str, dict[str, Any]] = {"fusion.motion_sigma": {"fusion.motion": "random_walk"}}
"""Values of other parameters with which a parameter has an effect."""

RANGES: dict[str, tuple[Any, ...]] = {
    "fusion.merging_threshold": (1.0, 9.0),
    "fusion.recognition_outlier_probability": (0.01, 0.4),
    "fusion.recognition_interval": (0.1, 10.0),
    "fusion.recognition_odds": (3.0, 200.0),
    "smoothing.change": (0.0, 10.0),
    "smoothing.jump": (15.0, 150.0),
    "smoothing.exchange": (-8.0, 8.0),
    "smoothing.longest": (0.5, 6.0),
    "smoothing.appearance": (0.0, 2.0),
}
"""Both ends of a range where half and double the default are too near to it to show an effect."""

BY_COLOUR = "fusion.recognition"
"""Parameters of this prefix are judged with ``colour_phd``, whose boxes have colours, in the rooms
alone."""

TABLE = Path(__file__).with_name("fusion_ablations.md")


@dataclass(frozen=True, slots=True)
class Trial:
    """One parameter changed; with none, what others of the same setting are compared with."""

    fusion: str
    """Name of the filter."""
    single_view: str = "none"
    """Name of the single-view method."""
    condition: str = ""
    """Key of :data:`CONDITIONS` whose values are set, or empty."""
    key: str = ""
    """Key of the changed parameter."""
    value: Any = None
    """The value of that parameter."""

    @property
    def parameters(self) -> RunParameters:
        """The defaults with the changes."""
        values = {"single_view": self.single_view, "fusion_method": self.fusion}
        values |= CONDITIONS.get(self.condition, {})
        return with_values(RunParameters(), values | ({self.key: self.value} if self.key else {}))

    @property
    def usual(self) -> Trial:
        """What it is compared with."""
        return replace(self, key="", value=None)

    def row_key(self, steps: int) -> str:
        """The key of a row: code, values and number of steps."""
        return row_key(self.single_view, self.parameters, steps)


def judged() -> tuple[str, ...]:
    """The parameters of fusion and smoothing, less published and essential ones."""
    return tuple(
        key for key in PARAMETERS if key.startswith(("fusion.", "smoothing.")) and is_free(key)
    )


def values_of(key: str) -> tuple[Any, ...]:
    """The values at which a parameter is judged."""
    return RANGES.get(key) or ends(key)


def trials(key: str, fusion: str) -> tuple[Trial, ...]:
    """The trials of a parameter, one for each value; none with a filter that does not read it."""
    colours = key.startswith(BY_COLOUR)
    if fusion != FILTERS[0] and (colours or key.startswith("smoothing.")):
        return ()
    condition = key if key in CONDITIONS else ""
    single_view = "colour_phd" if colours else "none"
    return tuple(Trial(fusion, single_view, condition, key, value) for value in values_of(key))


def steps_of(name: str, steps: int) -> int:
    """The number of steps of a sequence that are tracked; in rooms ``steps``."""
    return CROWD_STEPS if name in CROWDS else RECORDINGS.get(name, steps)


class Scenes:
    """The sequences of a study; what trials are compared with is computed once for each."""

    def __init__(self, folder: Path, steps: int) -> None:
        self._folder, self._steps = folder, steps
        self._sequences: dict[str, Sequence] = {}
        self._usual: dict[tuple[str, Trial], Run] = {}

    def steps(self, name: str) -> int:
        """The number of steps of a sequence that are tracked."""
        return steps_of(name, self._steps)

    def open(self, name: str) -> Sequence:
        """A recording by its name, or a room by its seed, rendered where it is not there yet."""
        if name not in self._sequences:
            if name in CROWDS:
                self._sequences[name] = random_room(
                    CROWDS[name], cameras=3, people=10, fps=4.0, steps=CROWD_STEPS
                )
                return self._sequences[name]
            folder = DATA / name if name in RECORDINGS else self._folder / name
            if name not in RECORDINGS and not (folder / "sequence.toml").is_file():
                render_random(int(name), folder, detections=True, frames=self._steps)
            sequence = read_sequence(folder)
            if name == TWO_CAMERAS:
                digest = f"{sequence.digest}-two-cameras"
                sequence = replace(sequence, views=sequence.views[:2], digest=digest)
            self._sequences[name] = sequence
        return self._sequences[name]

    def measure(self, name: str, trial: Trial) -> dict[str, Any]:
        """Run one trial in one sequence and evaluate its tracks."""
        sequence, own = self.open(name), (name, trial.usual)
        if own not in self._usual:
            self._usual[own] = pipeline.compute(
                sequence, trial.usual.parameters, steps=self.steps(name)
            )
        run = self._usual[own]
        if trial.key:
            run = pipeline.compute(sequence, trial.parameters, steps=self.steps(name), previous=run)
        return measured(sequence, run)


def measured(sequence: Sequence, run: Run) -> dict[str, float]:
    """The figures of a run; of a share of no positions 0."""
    evaluation, truth = (
        evaluate_sequence(sequence, run.tracks, steps=run.done),
        sequence.ground_truth,
    )
    positions = 0 if truth is None else int((truth.valid & (truth.frames < run.done)).sum())
    false = float(evaluation["false_per_step"] or 0.0) * run.done
    return {
        "found_share": float(evaluation["found_share"] or 0.0),
        "false_share": false / max(positions, 1),
        "idf1": float(evaluation["idf1"] or 0.0),
    }


def fill(rows: Rows, names: Iterable[str], keys: Iterable[str], steps: int, folder: Path) -> None:
    """Run what has no row yet; every row is written as soon as it is there."""
    for name in names:
        scenes = Scenes(folder, steps)
        for trial in (one for key in keys for fusion in FILTERS for one in trials(key, fusion)):
            if trial.single_view != "none" and (name in RECORDINGS or name in CROWDS):
                continue
            for one in (trial.usual, trial):
                own = (name, one.row_key(scenes.steps(name)))
                if own not in rows:
                    row = {"seed": name, "key": own[1], "parameter": one.key, "value": one.value}
                    row |= scenes.measure(name, one)
                    keep_row(folder, row)
                    rows[own] = row


def groups_of(rooms: Iterable[str]) -> dict[str, Iterable[str]]:
    """The groups of sequences over which means are taken."""
    return {"rooms": rooms, "crowds": CROWDS, "recordings": RECORDINGS}


def changes(rows: Rows, trial: Trial, names: Iterable[str], steps: int) -> list[float]:
    """The change of each figure's mean over the sequences that have both rows; empty for none."""
    both = []
    for name in names:
        length = steps_of(name, steps)
        own = [rows.get((name, one.row_key(length))) for one in (trial.usual, trial)]
        if own[0] is not None and own[1] is not None:
            both.append([own[1][f] - own[0][f] for f in FIGURES])
    return [float(change) for change in np.mean(both, axis=0)] if both else []


def effects(
    rows: Rows, key: str, groups: Mapping[str, Iterable[str]], steps: int
) -> dict[Trial, dict[str, list[float]]]:
    """The changes of the means over each group of sequences, by trial of a parameter."""
    return {
        trial: {name: changes(rows, trial, group, steps) for name, group in groups.items()}
        for fusion in FILTERS
        for trial in trials(key, fusion)
    }


def is_flat(found: Mapping[Trial, Mapping[str, list[float]]]) -> bool:
    """Whether no change of a parameter is as large as :data:`LEAST`."""
    return all(
        any(groups.values())  # what was not measured is not flat
        and all(abs(change) < LEAST for means in groups.values() for change in means)
        for groups in found.values()
    )


def table(rows: Rows, keys: Iterable[str], rooms: Mapping[str, Iterable[str]], steps: int) -> str:
    """The effects as a Markdown table.

    Args:
        rows: What was measured.
        keys: The parameters in the order of the table.
        rooms: The rooms in which each parameter was judged.
        steps: Number of steps of a room.
    """
    pieces = ", ".join(f"{name} ({length} steps)" for name, length in RECORDINGS.items())
    lines = [
        "# Fusion and smoothing: what each parameter changes",
        "",
        f"Random rooms with a detector's boxes, {steps} steps, {len(CROWDS)} random crowds of ten "
        f"people before three cameras, {CROWD_STEPS} steps, and the beginnings of recordings "
        f"({pieces}; of {TWO_CAMERAS} two cameras): change of the means of recall, "
        "false positives by true position, and IDF1 against the defaults, with the "
        "multi-Bernoulli filter and, after a slash, with the sequential PHD. Published and "
        f"essential parameters are not judged; {BY_COLOUR}… with `colour_phd`. *flat*: every "
        f"change is below {LEAST:g}. "
        "Made by `python -m tests.papers.rooms.fusion_ablations`.",
        "",
        "| parameter | value | rooms | in rooms | in crowds | in recordings | |",
        "|---|---|---|---|---|---|---|",
    ]
    for key in keys:
        names = list(rooms[key])
        found = effects(rows, key, groups_of(names), steps)
        for value in dict.fromkeys(trial.value for trial in found):
            own = [groups for trial, groups in found.items() if trial.value == value]
            cells = [
                " / ".join(" ".join(f"{c:+.3f}" for c in groups[name]) for groups in own)
                for name in groups_of(names)
            ]
            shown = f"{value:g}" if isinstance(value, float) else value
            flat = "flat" if is_flat(found) else ""
            there = sum(all(changes(rows, one, [name], steps) for one in found) for name in names)
            lines.append(f"| {key} | {shown} | {there} | {' | '.join(cells)} | {flat} |")
    return "\n".join(lines) + "\n"


def main(arguments: list[str] | None = None) -> int:
    """Measure what is missing and write the table; returns the exit status."""
    parser = common_arguments("fusion_ablations", TABLE, range(911, 917))
    more = range(917, 931)
    parser.add_argument("--more", type=int, nargs="*", default=more, help="of rooms for flat ones")
    parser.add_argument("--table-only", action="store_true", help="of what was run before")
    given = parser.parse_args(arguments)
    few = [str(seed) for seed in given.seeds]
    seeds = [*few, *map(str, given.more)]
    rows, keys, folder = read_rows(given.output), judged(), given.output
    if given.table_only:
        given.table.write_text(table(rows, keys, dict.fromkeys(keys, seeds), given.steps), "utf-8")
        return 0
    fill(rows, [*RECORDINGS, *CROWDS, *few], keys, given.steps, folder)
    flat = [key for key in keys if is_flat(effects(rows, key, groups_of(few), given.steps))]
    fill(rows, seeds, flat, given.steps, folder)
    rooms = {key: seeds if key in flat else few for key in keys}
    given.table.write_text(table(rows, keys, rooms, given.steps), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
