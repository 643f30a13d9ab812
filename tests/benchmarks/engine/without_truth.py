"""How well J stands for IDF1: ``python3 -m tests.benchmarks.engine.without_truth``.

Every recording of boxes and some random rooms are tracked with random settings; of each the
estimate J and the true IDF1 are kept in ``tracker/review/self_consistency/calibration.json``, from
which the program takes the interval that it tells. A run that was stopped goes on where it was.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from tests.conftest import DATA
from tests.random_rooms import random_room
from tracker.evaluation import evaluate_sequence
from tracker.parameters.catalogue import RunParameters
from tracker.parameters.values import with_values
from tracker.review.self_consistency import estimate
from tracker.review.self_consistency.estimate import FILE
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

RECORDINGS = ("cmc1", "cmc2", "av163-seq45-3p-1111-points", "wildtrack-points-300")
ROOMS = {
    "random room 1": {"seed": 1, "cameras": 4, "people": 6, "fps": 8.0},
    "random room 2": {"seed": 2, "cameras": 3, "people": 8, "fps": 4.0},
    "random room 3": {"seed": 3, "cameras": 5, "people": 7, "fps": 2.0},
}

SPREAD: dict[str, tuple[float, float]] = {
    "fusion.detection_probability": (0.6, 0.99),
    "fusion.clutter_rate": (0.05, 20.0),
    "fusion.acceleration_sigma": (0.1, 5.0),
    "fusion.measurement_sigma": (0.3, 4.0),
    "fusion.birth_rate": (0.001, 1.0),
}
"""Ranges of the random values, drawn evenly over their logarithms."""

CHOICES: dict[str, tuple[Any, ...]] = {
    "fusion_method": ("multi_bernoulli", "sequential_phd"),
    "smoothing_method": ("none", "positions", "identities"),
    "fusion.occlusion": (0.0, 0.4, 0.8),
}


def settings(number: int) -> dict[str, Any]:
    """The values of one setting; the defaults first."""
    if number == 0:
        return {}
    rng = np.random.default_rng(number)
    values: dict[str, Any] = {
        key: float(np.exp(rng.uniform(math.log(low), math.log(high))))
        for key, (low, high) in SPREAD.items()
    }
    for key, choices in CHOICES.items():
        values[key] = choices[int(rng.integers(len(choices)))]
    return values


def sequences(data: Path) -> dict[str, Sequence]:
    """What is tracked."""
    found = {name: random_room(**how) for name, how in ROOMS.items()}  # type: ignore[arg-type]
    for name in RECORDINGS:
        if (data / name / "sequence.toml").is_file():
            found[name] = read_sequence(data / name)
    return found


def main() -> int:
    """Measure what is missing, keep it, and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=DATA)
    parser.add_argument("--settings", type=int, default=60)
    parser.add_argument("--only", nargs="*", default=None, help="names of recordings")
    parser.add_argument("--seconds", type=float, default=math.inf, help="stop after so long")
    arguments = parser.parse_args()
    kept: dict[str, list[list[float]]] = {}
    if FILE.is_file():
        kept = json.loads(FILE.read_text(encoding="utf-8"))
    until = time.monotonic() + arguments.seconds
    base = RunParameters(single_view="none")
    whole = sequences(arguments.data)
    for number in range(arguments.settings):
        for name, sequence in whole.items():
            pairs = kept.setdefault(name, [])
            named = arguments.only is None or name in arguments.only
            if len(pairs) > number or not named or time.monotonic() > until:
                continue
            run = pipeline.compute(sequence, with_values(base, settings(number)))
            truth = evaluate_sequence(sequence, run.tracks)["idf1"]
            pairs.append([round(estimate(run).score, 4), round(float(truth or 0.0), 4)])
            FILE.write_text(_text(kept), encoding="utf-8")
    for name, pairs in kept.items():
        both = np.array(pairs)
        if len(both) > 2:
            rank = spearmanr(both[:, 0], both[:, 1]).statistic
            error = np.abs(both[:, 0] - both[:, 1])
            words = f"{name}: {len(both)} settings, Spearman {rank:.2f}, |J − IDF1| "
            sys.stdout.write(f"{words}{error.mean():.3f} mean, {np.median(error):.3f} median\n")
    return 0


def _text(kept: dict[str, list[list[float]]]) -> str:
    lines = ",\n".join(f"{json.dumps(k)}: {json.dumps(v)}" for k, v in kept.items() if v)
    return f"{{\n{lines}\n}}\n"


if __name__ == "__main__":
    sys.exit(main())
