"""Render, take samples, fit, three times."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from tests.rooms import render_random
from tests.training import boosting, samples
from tracker.single_view.shape.finder import FILE, Trees

SEEDS = tuple(range(41, 100))
"""Of the rooms that are learnt from; those below are for looking at what was learnt."""

ROUNDS = 3
"""Each takes windows that are hard for the trees of the one before; those of all are learnt."""


def main() -> None:
    """All rounds."""
    parser = argparse.ArgumentParser(prog="python -m tests.training", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the rooms are rendered, and stay")
    parser.add_argument("--seeds", type=int, nargs="+", default=list(SEEDS))
    parser.add_argument("--output", type=Path, default=FILE)
    arguments = parser.parse_args()
    for seed in arguments.seeds:
        if not (arguments.folder / str(seed) / "sequence.toml").is_file():
            render_random(seed, arguments.folder / str(seed))
    trees = Trees.read() if FILE.is_file() else None
    found = []
    for _ in range(ROUNDS):
        found += [samples.of_room(arguments.folder / str(s), trees) for s in arguments.seeds]
        means = np.concatenate([one[0] for one in found])
        people = np.concatenate([one[1] for one in found])
        print(f"{len(means)} windows, {int(people.sum())} on people")
        trees = boosting.fit(means, people)
    assert trees is not None
    trees.write(arguments.output)


if __name__ == "__main__":
    main()
