"""The page of results: tables and findings of experiments, from the records of their runs."""

from __future__ import annotations

import json
import math
import subprocess
import sys
import tempfile
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.stats import spearmanr

from tests.manual.places import RECORDS, ROOT, between
from tests.manual.records import machines, recordings, speed
from tests.papers.registry import EXPERIMENTS
from tracker.review.self_consistency.estimate import FILE as WITHOUT_TRUTH

FOLDER = RECORDS / "experiments"
KEPT = ("experiment", "version", "form", "claim", "findings", "table", "notes")
"""What the page needs of an experiment's document; all else is made anew with the run."""

OWN_MACHINE = ("steps/s", "frames/s")
"""Columns that tell of the machine more than of the method: they are not printed."""

SMALLER = "A smaller form, run as `python -m tests.papers {experiment} {form}`."

INTRODUCTION = """# Results

Every table on this page is printed from a record under `static/manual/records/`, and a test checks
that page and records agree. In a checkout one command makes the records again, with the real
recordings in the folder `DIR`:

```sh
python3 -m tests.manual --record --data DIR
```

`python -m tests.papers NAME --data DIR` runs one experiment, with its figure. An experiment that
was run in a smaller form states the form. The rooms are rendered: three of them are installed with
the program, with 600 steps each (`sequences`); `fig1` to `fig3` and `methods` render 1,500 steps of
the same scenes, since the papers' claims are about later steps. AV16.3 and the Curtin recordings
(`cmc1`, `cmc2`) are real ([sources](methods.md#sources)).

*Found* is the share of true positions with an estimate within the stated distance, *error* the mean
distance of the matched ones; [`tracker.evaluation`](api/evaluation.md) defines all other figures. A
*gate* is the distance above which an estimate and a true position are not matched. In the first
table *better* means that the claim holds or is exceeded, and *worse* that it is not reached.

## Limits

- Colours need templates, and people whose clothes differ; without templates people are detected by
  shape, which fails most often where people sit, never leave their place, or the picture is noisy
  ([`rooms`](#rooms)), and on real pictures more often than in rendered ones
  ([`methods`](#methods)).
- A person who is more than half hidden in all cameras is often not tracked ([`fig2`](#fig2),
  [`fig3`](#fig3)).
- Answers to the review queue correct only part of the identity errors
  ([`corrections`](#corrections)).
- Most recordings here have few people and last for a minute or less. `wildtrack-points-300` is the
  one crowd. In the two recordings whose names contain `points` the boxes are not those of a
  detector: they are made from hand-marked points and boxes, with simulated noise, misses and
  clutter, so tracks are more accurate there than with a detector.
"""

IDENTITY = """## Identity without truth

Each recording was tracked with random settings; of each the estimate J without ground truth
([Methods](methods.md#identity-without-truth)) is compared with the true IDF1. The correlation is
Spearman's, over the settings of one recording. The program takes the interval beside J from the
same record, which `python3 -m tests.benchmarks.engine.without_truth` makes.
"""

BOUNDS = (0.0, 0.5, 0.8, 0.95, math.inf)
"""Bounds of J between which the mean error is stated."""


def record(names: list[str], data: Path) -> None:
    """Run experiments, and keep what the page prints.

    Args:
        names: Which ones.
        data: The folder of the real recordings.

    Raises:
        subprocess.CalledProcessError: If one cannot be run.
    """
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            line = [sys.executable, "-m", "tests.papers", name]
            line += ["--output", folder, "--data", str(data)]
            subprocess.run(line, check=True, cwd=ROOT)
            keep(Path(folder, f"{name}.json"))


def keep(path: Path) -> None:
    """Take an experiment's document into the records, with the form in which it was run."""
    document = json.loads(path.read_text(encoding="utf-8"))
    flags = ["--quick"] if document["quick"] else []
    flags += [f"--seeds {document['seeds']}"] if document["seeds"] else []
    document["form"] = " ".join(flags)
    table = document["table"]
    columns = [k for k, word in enumerate(table["head"]) if word not in OWN_MACHINE]
    document["table"] = {
        "head": [table["head"][k] for k in columns],
        "rows": [[row[k] for k in columns] for row in table["rows"]],
    }
    text = json.dumps({key: document[key] for key in KEPT}, indent=1, ensure_ascii=False)
    (FOLDER / f"{document['experiment']}.json").write_text(text + "\n", encoding="utf-8")


def kept() -> list[dict[str, Any]]:
    """The records, in the order in which the experiments are run."""
    paths = [FOLDER / f"{name}.json" for name in EXPERIMENTS]
    return [json.loads(p.read_text(encoding="utf-8")) for p in paths if p.is_file()]


def page() -> str:
    """The whole page."""
    documents = kept()
    parts = [INTRODUCTION, "## Claims of the papers, run again", "", _claims(documents), ""]
    for document in documents:
        parts += [f"## {document['experiment']}", "", f"> {document['claim']}", ""]
        if document["form"]:
            parts += [SMALLER.format(**document), ""]
        parts += [_table(document["table"]), ""]
        parts += [f"{note}\n" for note in document["notes"]]
    parts += [_without_truth(), recordings.section(), speed.section(), machines.section()]
    return "\n".join(parts).rstrip() + "\n"


def _without_truth() -> str:
    """The part on identity without truth, from the record by which the program calibrates J."""
    kept = json.loads(WITHOUT_TRUTH.read_text(encoding="utf-8"))
    pairs = {name: np.array(own) for name, own in kept.items()}
    rows = []
    for name, own in pairs.items():
        correlation = f"{spearmanr(own[:, 0], own[:, 1]).statistic:.2f}"
        rows.append([name, f"{len(own)} settings", correlation, *_errors(own)])
    every = np.concatenate(list(pairs.values()))
    for low, high in reversed([*pairwise(BOUNDS)]):
        own = every[(every[:, 0] >= low) & (every[:, 0] < high)]
        words = f"J from {low:g}" + (f" to {high:g}" if math.isfinite(high) else "")
        rows.append([words, f"{len(own)} settings", "", *_errors(own)])
    head = ["recording", "of", "correlation", "mean of abs(J − IDF1)", "mean of J − IDF1"]
    return "\n".join([IDENTITY, _table({"head": head, "rows": rows}), ""])


def _errors(pairs: Float[ndarray, "n 2"]) -> list[str]:
    """The mean size of J − IDF1, and its mean."""
    error = pairs[:, 0] - pairs[:, 1]
    return [f"{np.abs(error).mean():.2f}", f"{error.mean():+.2f}"]


def readme() -> str:
    """The README with its table of figures."""
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    shown = next(d for d in kept() if d["experiment"] == "sequences")
    wanted = [
        "sequence",
        "tracks",
        "cameras",
        "people",
        "MOTA",
        "IDF1",
        "HOTA",
        "error (m)",
        "found",
    ]
    columns = [shown["table"]["head"].index(word) for word in wanted]
    rows = [[row[k] for k in columns] for row in shown["table"]["rows"]]
    return between(text, "results", _table({"head": wanted, "rows": rows}))


def _claims(documents: list[dict[str, Any]]) -> str:
    rows = [
        [f"`{d['experiment']}`", f["claim"], f"**{f['verdict']}**", f["found"]]
        for d in documents
        for f in d["findings"]
    ]
    return _table({"head": ["experiment", "claim", "", "found"], "rows": rows})


def _table(table: dict[str, Any]) -> str:
    def line(cells: list[str]) -> str:
        return f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"

    rule = f"|{'---|' * len(table['head'])}"
    return "\n".join([line(table["head"]), rule, *map(line, table["rows"])])
