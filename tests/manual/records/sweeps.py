"""Short runs over the values of each parameter: what the pictures of the page of tuning show."""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path
from typing import Any

from tests.golden.pieces import PIECES, cut
from tests.manual.places import RECORDS
from tracker.evaluation import evaluate_sequence
from tracker.parameters.catalogue import PARAMETERS, REGISTERED, Parameter, RunParameters
from tracker.parameters.values import with_values
from tracker.runs import pipeline
from tracker.runs.pipeline import Run
from tracker.sequences.library import open_sequence
from tracker.sequences.reader import read_sequence
from tracker.sequences.sequence import Sequence

FILE = RECORDS / "sweeps.json"

ROOM, FIRST, FRAMES = "room44-3p", 360, 600
"""Steps of a rendered room in which three people walk about."""
STEPS = {"single_view": 90, "fusion": 400, "smoothing": 400, "tracks": 400}
"""That are run, by the stage of the parameter."""
VALUES = {"single_view": 4, "fusion": 6, "smoothing": 6, "tracks": 6}
"""Values over the range, beside the default."""

FIGURES = {"found_share": 4, "false_per_step": 4, "position_error": 4}
"""What is kept of each run, with decimals."""

ON_BOXES = ("detection_boxes", "detection_phd")
"""Groups of methods that need an outside detector's boxes: they are swept on a recording."""


def values(parameter: Parameter) -> list[Any]:
    """What is tried: all choices, or values over the range with the default among them."""
    if parameter.kind == "bool":
        return [False, True]
    if parameter.kind == "choice":
        return list(parameter.choices)
    assert parameter.minimum is not None
    assert parameter.maximum is not None
    low, high, count = parameter.minimum, parameter.maximum, VALUES[parameter.stage]
    shares = [k / (count - 1) for k in range(count)]
    if parameter.log:
        tried = [low * (high / low) ** share for share in shares]
    else:
        tried = [low + (high - low) * share for share in shares]
    digits = [float(f"{value:.3g}") for value in tried]
    if parameter.kind == "int":
        digits = [round(value) for value in digits]
    return sorted({*(min(max(value, low), high) for value in digits), parameter.default})


def chosen(names: list[str]) -> list[Parameter]:
    """The parameters of some groups or keys, in the order of definition; all, if none is named.

    Raises:
        ValueError: If a name is neither a group nor a key.
    """
    known = {*PARAMETERS, *(p.group for p in PARAMETERS.values())}
    if unknown := [name for name in names if name not in known]:
        raise ValueError(f"expected groups or keys of parameters, got {', '.join(unknown)}")
    return [p for p in PARAMETERS.values() if not names or {p.key, p.group} & {*names}]


def record(names: list[str], data: Path) -> None:
    """Run the pieces, and keep what came out.

    Args:
        names: Groups or keys of parameters; all, if none is named.
        data: The folder of the real recordings.

    Raises:
        ValueError: If a name is neither a group nor a key.
    """
    found = kept()
    wanted = chosen(names)
    for group in dict.fromkeys(p.group for p in wanted):
        name, sequence = _piece(group, data)
        base: Run | None = None
        for parameter in (p for p in wanted if p.group == group):
            steps = STEPS[parameter.stage]
            points = []
            for value in values(parameter):
                if _impossible(parameter, value):
                    continue
                changes = {**_base(group, parameter), parameter.key: value}
                parameters = with_values(RunParameters(), changes)
                run = pipeline.compute(sequence, parameters, steps=steps, previous=base)
                if parameter.stage != "single_view":
                    base = run
                points.append([value, *_figures(sequence, run)])
            found[parameter.key] = {"sequence": name, "steps": steps, "points": points}
            sys.stdout.write(f"{parameter.key}: {points}\n")
            sys.stdout.flush()
            _write(found)


def kept() -> dict[str, Any]:
    """What earlier runs left, by the parameter's key."""
    if not FILE.is_file():
        return {}
    found: dict[str, Any] = json.loads(FILE.read_text(encoding="utf-8"))
    return found


def _piece(group: str, data: Path) -> tuple[str, Sequence]:
    if group in ON_BOXES:
        piece = next(piece for piece in PIECES if piece.name == "cmc2")
        whole = read_sequence(data / piece.name)
        return piece.name, cut(whole, piece.first, piece.frames)
    return ROOM, cut(open_sequence(ROOM), FIRST, FRAMES)


def _base(group: str, parameter: Parameter) -> dict[str, Any]:
    """The method that reads a group, and what else must be chosen for a value to matter."""
    changes: dict[str, Any] = {"fusion_method": "multi_bernoulli"}
    if group == "smoothing":
        changes["smoothing_method"] = "identities"
    if group in ("fusion", "foreground", "smoothing"):
        changes["single_view"] = "colour_phd"
    else:
        changes["single_view"] = next(
            name for name, method in REGISTERED["single_view"].items() if method.own_group == group
        )
    # a help text that begins with one of a choice's values tells what it belongs to
    word = parameter.help.partition(":")[0].strip().lower().replace(" ", "_")
    for other in PARAMETERS.values():
        if other.group == group and other.kind == "choice" and word in other.choices:
            changes[other.key] = word
    if word == "sequential_phd":
        changes["fusion_method"] = word
    return changes


def _impossible(parameter: Parameter, value: Any) -> bool:
    """Whether a rendered room lacks what a choice asks for."""
    return parameter.key == "jpda.measurements" and value == "detections"


def _figures(sequence: Sequence, run: Run) -> list[float | None]:
    evaluation = evaluate_sequence(sequence, run.tracks, steps=run.done)
    found = []
    for key, digits in FIGURES.items():
        figure = evaluation[key]
        known = figure is not None and math.isfinite(figure)
        found.append(round(float(figure or 0.0), digits) if known else None)
    return found


def _write(found: dict[str, Any]) -> None:
    ordered = {key: found[key] for key in PARAMETERS if key in found}
    lines = ",\n".join(
        f"{json.dumps(k)}: {json.dumps(v, ensure_ascii=False)}" for k, v in ordered.items()
    )
    FILE.parent.mkdir(parents=True, exist_ok=True)
    FILE.write_text(f"{{\n{lines}\n}}\n", encoding="utf-8")
