"""``python -m tests.io.checks``: what is named, what is found and how soon, on many recordings.

Three tables: the usual mistakes, each made in every recording that has boxes, with the remedies
that are named; cameras made late on purpose, with the offsets that are found; and folders as their
makers give them, imported without a flag and tracked. ``--record`` keeps the figures for the
manual; recordings that are not named keep theirs.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tests.conftest import DATA
from tests.manual.places import RECORDS, ROOT
from tests.mistakes import MISTAKES
from tests.random_rooms import random_room
from tracker.io.checks import check
from tracker.io.checks.synchronisation import synchronise
from tracker.io.importing.gathering import gather
from tracker.io.importing.settling import settle
from tracker.io.importing.writing import as_sequence
from tracker.sequences.library import open_sequence
from tracker.sequences.sequence import Sequence

FILE = RECORDS / "checks.json"
FOREIGN = DATA.parent / "foreign"

WITH_BOXES = ("cmc1", "cmc2", "wildtrack-points-300", "av163-seq45-3p-1111-points")
WITH_PICTURES = ("av163-seq30-2p-1101",)
ROOMS = ("room24-2p", "room35-2p", "room44-3p")
RANDOM = tuple(f"random room {seed}" for seed in range(6))
LATE = (-25, -10, 7, 20, 40)
LEAST_LEFT = 40
"""Steps of a recording that must be left where a camera is made late: both ends are cut off."""


def foreign() -> tuple[str, ...]:
    """Folders as their makers give them."""
    return tuple(sorted(p.name for p in FOREIGN.glob("*") if p.is_dir()))


def opened(name: str) -> Sequence:
    """A recording by its name."""
    if name in RANDOM:
        return random_room(RANDOM.index(name))
    if name in foreign():
        return as_sequence(settle(gather([FOREIGN / name])), name)
    return open_sequence(name if name in ROOMS else DATA / name)


def there(names: tuple[str, ...]) -> Iterator[str]:
    """Those that are on this machine."""
    for name in names:
        if name in (*ROOMS, *RANDOM, *foreign()) or (DATA / name).is_dir():
            yield name


def say(text: str) -> None:
    """One line."""
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


def mistakes(name: str) -> dict[str, Any]:
    """The warnings about a good recording, and the remedies named for each mistake in it."""
    sequence = opened(name)
    alarms = [str(found) for found in check(sequence) if found.status == "warning"]
    named: dict[str, list[str]] = {}
    first, second = (view.camera.name for view in sequence.views[:2])
    for mistake, (make, wanted) in MISTAKES.items() if sequence.has_detections else ():
        remedy = f"--swap {first}={second}" if "--swap" in wanted else wanted
        found = [each for each in check(make(sequence)) if each.status == "warning"]
        own = [str(remedy) for each in found for remedy in each.remedies]
        named[mistake] = ["right"] if own == [remedy] else own
    right = sum(own == ["right"] for own in named.values())
    say(f"{name}: {len(alarms)} false alarms {alarms or ''}, {right} of {len(named)} named")
    for mistake, own in named.items():
        if own != ["right"]:
            say(f"  {mistake}: {own}")
    return {"false alarms": alarms, "named": named}


def late_pictures(sequence: Sequence, steps: int) -> Sequence:
    """The second camera's pictures late by so many steps; both ends are cut off for it."""
    margin = abs(steps)
    views = [
        replace(view, first_frame=view.first_frame + margin - (steps if camera == 1 else 0))
        for camera, view in enumerate(sequence.views)
    ]
    return replace(sequence, views=tuple(views), frames=sequence.frames - 2 * margin)


def half_a_frame(sequence: Sequence) -> Sequence:
    """Every other picture, of the second camera those in between: early by half a step."""
    frames = sequence.frames // 2
    views = []
    for camera, view in enumerate(sequence.views):
        shown = 2 * np.arange(frames) + view.first_frame + (camera == 1)
        clock = _Clock(shown)
        views.append(replace(view, clock=clock))
    return replace(sequence, views=tuple(views), frames=frames, fps=sequence.fps / 2.0)


class _Clock:
    """Just which frame each step shows."""

    def __init__(self, frame_of_step: np.ndarray) -> None:
        self.frame_of_step = frame_of_step


def offsets(name: str) -> dict[str, Any]:
    """Offsets found from pictures, of a camera made late, by how many frames it is."""
    sequence = opened(name)
    cases = [
        (float(steps), late_pictures(sequence, steps))
        for steps in LATE
        if sequence.frames - 2 * abs(steps) >= LEAST_LEFT
    ]
    result = {}
    for late, shifted in [*cases, (-0.5, half_a_frame(sequence))]:
        found = synchronise(shifted, source="motion")
        # which of two cameras is the late one nobody can know
        result[f"{late:g}"] = round(found[1].steps - found[0].steps, 2)
        say(f"{name}: late by {late:g} frames, found {result[f'{late:g}']:.1f}")
    return result


def imports(name: str) -> dict[str, Any]:
    """Seconds from a folder's files to tracks by two commands, and how good these are."""
    with tempfile.TemporaryDirectory() as folder:
        place, tracks = Path(folder, name), Path(folder, "tracks.csv")
        app = [sys.executable, "-m", "app"]
        begin = time.perf_counter()
        # 1: a check warns, and the folder is there nevertheless
        status = subprocess.run([*app, "import", str(FOREIGN / name), "-o", str(place)], cwd=ROOT)
        assert status.returncode in (0, 1), status
        between = time.perf_counter()
        line = [*app, "track", str(place), "-o", str(tracks), "--no-cache", "--keep", "0"]
        subprocess.run(line, check=True, cwd=ROOT)
        end = time.perf_counter()
        sequence = open_sequence(place)
        result: dict[str, Any] = {
            "cameras": len(sequence.views), "steps": sequence.frames,
            "import seconds": round(between - begin, 1), "track seconds": round(end - between, 1),
        }  # fmt: skip
        if sequence.ground_truth is not None:
            line = [*app, "evaluate", str(place), str(tracks), "--json"]
            done = subprocess.run(line, check=True, cwd=ROOT, stdout=subprocess.PIPE)
            for figure in json.loads(done.stdout)["figures"]:
                if figure["key"] in ("mota", "idf1"):
                    result[figure["key"]] = round(figure["value"], 3)
    say(f"{name}: {result}")
    return result


TABLES: dict[str, tuple[Callable[[str], dict[str, Any]], Callable[[], tuple[str, ...]]]] = {
    # the poses of pose2sim-multi are of another cut of its videos: what is said of them is true
    "mistakes": (mistakes, lambda: (*WITH_BOXES, *WITH_PICTURES, *ROOMS, *RANDOM, "wildtrack-60")),
    "offsets": (offsets, lambda: (*ROOMS, *WITH_PICTURES, "pose2sim-multi")),
    "imports": (imports, foreign),
}


def main() -> None:
    """Make the tables that are asked for, a recording after the other."""
    parser = argparse.ArgumentParser(prog="python -m tests.io.checks", description=__doc__)
    parser.add_argument("tables", nargs="*", choices=[*TABLES, []], default=[])
    parser.add_argument("--only", nargs="+", default=None, metavar="RECORDING")
    parser.add_argument("--record", action="store_true", help=f"keep the figures in {FILE.name}")
    arguments = parser.parse_args()
    for table in arguments.tables or TABLES:
        make, names = TABLES[table]
        for name in there(names()):
            if arguments.only is not None and name not in arguments.only:
                continue
            found = make(name)
            if arguments.record:
                kept = json.loads(FILE.read_text(encoding="utf-8")) if FILE.is_file() else {}
                kept.setdefault(table, {})[name] = found
                FILE.write_text(json.dumps(kept, indent=1, ensure_ascii=False) + "\n", "utf-8")


if __name__ == "__main__":
    main()
