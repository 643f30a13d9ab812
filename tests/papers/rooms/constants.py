"""What a constant of fusion or smoothing changes.

``python -m tests.papers.rooms.constants tracker.smoothing.smoother._SCALE_TIME 4 16`` tracks random
crowds and the beginnings of recordings with each value, and prints how the means of recall, false
positives by true position, IDF1 and the error of positions change, and by how much at most in one.
"""

from __future__ import annotations

import argparse
import sys
from ast import literal_eval
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy import ndarray

from tests.conftest import DATA
from tests.papers.rooms.fusion_ablations import CROWD_STEPS, RECORDINGS, Scenes, measured
from tests.random_rooms import random_room
from tracker.evaluation import evaluate_sequence
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.sequences.sequence import Sequence

SEEDS = range(1500, 1506)
"""Of the random crowds."""

FIGURES = ("recall", "false", "idf1", "millimetres")


@contextmanager
def set_to(constant: str, value: Any) -> Iterator[None]:
    """Give a constant another value in its module, and wherever that was imported by name."""
    module, _, name = constant.rpartition(".")
    old = getattr(import_module(module), name)
    there = [
        one
        for key, one in list(sys.modules.items())
        if key == module or (key.startswith("tracker.") and vars(one).get(name) is old)
    ]
    for one in there:
        setattr(one, name, value)
    try:
        yield
    finally:
        for one in there:
            setattr(one, name, old)


def figures(sequence: Sequence, steps: int) -> ndarray:
    """:data:`FIGURES` of one run with the default parameters."""
    parameters = with_values(RunParameters(), {"single_view": "none"})
    run = pipeline.compute(sequence, parameters, steps=steps)
    error = evaluate_sequence(sequence, run.tracks, steps=run.done)["position_error"]
    return np.array([*measured(sequence, run).values(), 1000.0 * float(error or 0.0)])


def scenes() -> dict[str, tuple[Sequence, int]]:
    """The random crowds and recordings, each with the number of steps that are tracked."""
    crowds = {
        f"crowd {seed}": random_room(seed, cameras=3, people=10, fps=4.0, steps=CROWD_STEPS)
        for seed in SEEDS
    }
    known = Scenes(Path(), 0)
    return {name: (crowd, CROWD_STEPS) for name, crowd in crowds.items()} | {
        name: (known.open(name), known.steps(name)) for name in RECORDINGS if (DATA / name).is_dir()
    }


def main(arguments: list[str] | None = None) -> int:
    """Print a line for each value and group of scenes; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.papers.rooms.constants")
    parser.add_argument("constant", help="module and name, with points between")
    parser.add_argument("values", nargs="+", type=literal_eval)
    given = parser.parse_args(arguments)
    there = scenes()
    usual = {name: figures(*scene) for name, scene in there.items()}
    for value in given.values:
        with set_to(given.constant, value):
            changes = {name: figures(*scene) - usual[name] for name, scene in there.items()}
        for group in ("crowd", "recording"):
            own = [
                row for name, row in changes.items() if (name in RECORDINGS) != (group == "crowd")
            ]
            if own:
                means, most = np.mean(own, axis=0), np.abs(own).max(axis=0)
                cells = [
                    f"{f} {m:+.4f} (at most {x:.4f})"
                    for f, m, x in zip(FIGURES, means, most, strict=True)
                ]
                sys.stdout.write(f"{value} in {group}s: {', '.join(cells)}\n")
                sys.stdout.flush()
    return 0


if __name__ == "__main__":
    sys.exit(main())
