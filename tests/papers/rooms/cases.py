"""What is run in a random room: every single-view method, with and without templates."""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import shutil
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from tests.papers.laboratory import runs
from tests.papers.rooms.kept import keep_row
from tests.rooms import RenderCancelled, choose, render_random
from tests.rooms.random_rooms import VERSION
from tracker.evaluation import evaluate_sequence
from tracker.parameters import Stage
from tracker.parameters.catalogue import METHODS, RunParameters, method_of
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.numbers_version import method_version, numbers_version
from tracker.runs.processes import WorkerControl
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

NICENESS = 5

FIGURES = ("found_share", "false_per_step", "position_error", "idf1")


@dataclass(frozen=True, slots=True)
class Case:
    """A way to track in a room."""

    method: str
    """Of stage 1."""
    templates: bool
    """Whether the marked boxes are there."""

    @property
    def on_pictures(self) -> bool:
        """Whether it looks at pictures and not at boxes that come with the room."""
        used = method_of("single_view", self.method).used(RunParameters())
        return used.pictures and not used.detections

    @property
    def name(self) -> str:
        """As the tables name it."""
        return f"{self.method}, {'with' if self.templates else 'without'} templates"


@dataclass(frozen=True, slots=True)
class Item:
    """A room to be measured."""

    seed: int
    cases: tuple[tuple[Case, str], ...]
    """What is still to be run there, each with its key."""
    folder: Path
    """Where it is rendered."""
    keep: bool
    """Whether it stays there."""
    output: Path | None
    """Folder where each row is kept as soon as it is there."""
    steps: int | None = None
    """Only so many, for a first look."""


def cases() -> tuple[Case, ...]:
    """Every method with templates where it can use them, and without where it can do without.

    Those on an outside detector's boxes take the boxes that come with the rooms.
    """
    found = []
    for name in METHODS["single_view"]:
        used = method_of("single_view", name).used(RunParameters())
        if used.detector or not (used.pictures or used.detections):
            continue
        if used.templates != "no":
            found.append(Case(name, True))
        if used.templates != "needed":
            found.append(Case(name, False))
    return tuple(found)


def key_of(case: Case, steps: int | None) -> str:
    """Of what a row depends on beside the room: code, numbers, and how much of it is tracked."""
    method = method_of("single_view", case.method)
    stages: tuple[Stage, ...] = ("single_view", "fusion", "tracks")
    code = [numbers_version(stage) for stage in stages]
    values = parameters_of(case).model_dump(mode="json")
    parts = [VERSION, code, method_version(method), values, case.templates, steps]
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()[:16]


def steps_of(item: Item) -> int:
    """What the work's advances sum to: rendering counts as one more run."""
    steps = choose(item.seed).steps if item.steps is None else item.steps
    return steps * (1 + len(item.cases))


def measure(item: Item, control: WorkerControl) -> list[dict[str, Any]]:
    """Render a room and run what is to be run in it.

    Returns:
        A row for each case: seed, method, templates, the figures and the room's labels.
    """
    _give_way()
    told = 0

    def rendered(done: int, total: int) -> None:
        nonlocal told
        control.advance(done - told)
        told = done

    if not (item.folder / "sequence.toml").is_file():
        try:
            render_random(
                item.seed, item.folder, detections=True, frames=item.steps, progress=rendered,
                cancelled=control.cancelled,
            )  # fmt: skip
        except RenderCancelled:
            raise pipeline.Cancelled from None
    try:
        sequence = read_sequence(item.folder)
        labels = choose(item.seed).causes()
        rows = []
        for case, key in item.cases:
            row = _row(item, case, sequence, control) | {"causes": labels, "key": key}
            keep_row(item.output, row)
            rows.append(row)
        return rows
    finally:
        if not item.keep:
            shutil.rmtree(item.folder)


def _give_way() -> None:
    """A process that works for many minutes leaves the machine to whoever sits before it."""
    if multiprocessing.parent_process() is not None and hasattr(os, "nice"):
        os.nice(max(0, NICENESS - os.nice(0)))


def parameters_of(case: Case) -> RunParameters:
    """Defaults, with the method."""
    return with_values(RunParameters(), {"single_view": case.method})


def _row(item: Item, case: Case, sequence: Sequence, control: WorkerControl) -> dict[str, Any]:
    if not case.templates:
        sequence = replace(sequence, templates=(), digest=f"{sequence.digest}-without-templates")
    steps = sequence.frames
    row: dict[str, Any] = {"seed": item.seed, "method": case.method, "templates": case.templates}
    method = method_of("single_view", case.method)
    if method.used(parameters_of(case)).templates == "needed" and not sequence.templates:
        # nobody could be marked, so nobody is found
        nothing = {"found_share": 0.0, "false_per_step": 0.0, "idf1": 0.0}
        figures: dict[str, Any] = dict.fromkeys(FIGURES) | nothing
        return row | figures | {"steps": steps, "seconds": None}
    begin = time.perf_counter()
    run = runs.tracked(sequence, parameters_of(case), control, seed=0, steps=steps)
    seconds = time.perf_counter() - begin
    evaluation = evaluate_sequence(sequence, run.tracks, steps=run.done)
    figures = {key: evaluation[key] for key in FIGURES}
    return row | figures | {"steps": steps, "seconds": seconds}
