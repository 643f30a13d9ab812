"""``python -m tests.io.scoreboard --folders N --seed S``: how generated folders are imported.

Counts by defect and by form which imports are right, asked about, refused, wrong, with a warning
of the check if ``--check`` asks it, and wrong without a word. ``--only K`` makes folder K alone;
``--part I/N`` every N-th from the I-th on.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from tests.io.folders import MOST_FRAMES, Known, judge, make_folder
from tracker.io.checks import check
from tracker.io.conventions.questions import OF_ONE, OF_TWO, UNPROVEN
from tracker.io.importing.gathering import gather
from tracker.io.importing.settling import settle
from tracker.io.importing.writing import as_sequence
from tracker.io.read.pieces import FormatError

OUTCOMES = ("right", "asked", "refused", "warned", "silent")


def outcome(folder: Path, known: Known, *, checked: bool) -> tuple[str, str]:
    """One of :data:`OUTCOMES`, and why; without the check what is wrong is silently so."""
    try:
        plan = settle(gather([folder]), known.options)
    except FormatError as error:
        asked = "Undecided" in type(error).__name__
        return ("asked" if asked else "refused"), str(error)
    wrong = judge(plan, known)
    if not wrong:
        return "right", ""
    if {OF_ONE, OF_TWO, UNPROVEN} & set(plan.told):
        return "asked", f"{wrong}; that nothing confirms it is said"
    if not checked:
        return "silent", wrong
    checks = check(as_sequence(plan, "generated"), pictures=False)
    warned = [str(one) for one in checks if one.status == "warning"]
    return ("warned", f"{wrong}; {warned[0]}") if warned else ("silent", wrong)


def score(
    seed: int,
    number: int,
    defect: str | None = None,
    *,
    most_frames: int = MOST_FRAMES,
    checked: bool = False,
) -> tuple[Known, str, str, float]:
    """Make and import one folder."""
    rng = np.random.default_rng([seed, number])
    with tempfile.TemporaryDirectory() as place:
        known = make_folder(Path(place), rng, defect, most_frames)
        begin = time.process_time()
        found, why = outcome(Path(place), known, checked=checked)
        return known, found, why, time.process_time() - begin


def main() -> None:
    """Print a line a folder and the two tables."""
    parser = argparse.ArgumentParser(prog="python -m tests.io.scoreboard", description=__doc__)
    parser.add_argument("--folders", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, default=None)
    parser.add_argument("--part", default="0/1", metavar="I/N")
    parser.add_argument("--defect", default=None)
    parser.add_argument("--check", action="store_true", help="also check what is wrong (slow)")
    arguments = parser.parse_args()
    part, parts = map(int, arguments.part.split("/"))
    numbers = range(part, arguments.folders, parts)
    table: Counter[tuple[str, str]] = Counter()
    forms: Counter[tuple[str, str]] = Counter()
    seconds = []
    for number in numbers if arguments.only is None else [arguments.only]:
        known, found, why, lasting = score(
            arguments.seed, number, arguments.defect, checked=arguments.check
        )
        table[known.defect, found] += 1
        for word in (known.form.split(",")[0], *known.form.split(", ")[1:2]):
            forms[word, found] += 1
        seconds.append(lasting)
        sys.stdout.write(
            f"{number} {found} {lasting:.1f} s | {known.defect} | {known.form} | {why}\n"
        )
        sys.stdout.flush()
    for counts in (forms, table):
        sys.stdout.write(f"\n{'':28}{''.join(f'{one:>9}' for one in OUTCOMES)}\n")
        for name in sorted({name for name, _ in counts}):
            row = "".join(f"{counts[name, one]:9}" for one in OUTCOMES)
            sys.stdout.write(f"{name:28}{row}\n")
    total = "".join(f"{sum(table[n, one] for n, o in table if o == one):9}" for one in OUTCOMES)
    sys.stdout.write(f"{'all':28}{total}\n")
    sys.stdout.write(f"median {np.median(seconds):.1f} s, longest {max(seconds):.1f} s\n")


if __name__ == "__main__":
    main()
