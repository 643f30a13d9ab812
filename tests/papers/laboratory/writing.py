"""An experiment's figure and numbers on disk, whole or not at all."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from tests.papers.laboratory.experiment import Experiment, Result
from tracker import __version__
from tracker.files.atomic import replacing


def document(
    experiment: Experiment, result: Result, *, quick: bool, seeds: int | None
) -> dict[str, Any]:
    """Everything that was found, as JSON takes it."""
    return {
        "experiment": experiment.name,
        "version": __version__,
        "quick": quick,
        "seeds": seeds,
        "claim": experiment.claim,
        "findings": [
            {"claim": f.claim, "found": f.found, "verdict": f.verdict} for f in result.findings
        ],
        "table": {
            "head": [name.removeprefix(">") for name in result.head],
            "rows": [list(row) for row in result.rows],
        },
        "notes": list(result.notes),
        "numbers": result.numbers,
    }


def write(
    experiment: Experiment,
    result: Result,
    folder: Path,
    *,
    quick: bool = False,
    seeds: int | None = None,
) -> list[Path]:
    """Write ``NAME.json`` and, where there is a figure, ``NAME.png``.

    Args:
        experiment: Which one.
        result: What it found.
        folder: Made where it is not there.
        quick: Whether it was shortened.
        seeds: How many it was run with in place of its own number.

    Returns:
        The files.

    Raises:
        OSError: If they cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(
        document(experiment, result, quick=quick, seeds=seeds),
        indent=1,
        ensure_ascii=False,
        allow_nan=False,
    )
    contents = {folder / f"{experiment.name}.json": (text + "\n").encode()}
    if result.figure is not None:
        from tests.papers.laboratory.drawing import png

        contents[folder / f"{experiment.name}.png"] = png(result.figure)
    for path, content in contents.items():
        with replacing(path) as temporary:
            temporary.write_bytes(content)
    return list(contents)
