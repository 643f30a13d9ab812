"""What of a machine may be another without another result: one thing exchanged at a time.

Each row runs the first steps of a rendered room, drawn afresh, in a process whose libraries are
told to use other code than this processor would choose, and compares every array bit for bit.
"""

from __future__ import annotations

import hashlib
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests.golden.exact import of_run
from tests.manual.places import RECORDS, ROOT
from tests.rooms import render
from tracker.parameters.catalogue import RunParameters
from tracker.runs import pipeline
from tracker.sequences.reader import read_sequence

FILE = RECORDS / "machines.json"
ROOM = "room24-2p"
STEPS = 300

EXCHANGED: dict[str, dict[str, str]] = {
    "linear algebra for an older processor (OpenBLAS, Prescott)": {"OPENBLAS_CORETYPE": "Prescott"},
    "linear algebra in one thread": {"OPENBLAS_NUM_THREADS": "1"},
    "NumPy without AVX2 and AVX512": {
        "NPY_DISABLE_CPU_FEATURES": "AVX2 FMA3 AVX512F AVX512CD AVX512_SKX"
    },
    "OpenCV without AVX2 and AVX512": {"OPENCV_CPU_DISABLE": "AVX2,FP16,AVX512-SKX"},
    "OpenCV without Intel's IPP": {"OPENCV_IPP": "disabled"},
    "one core": {"MACHINE_CORES": "1"},
    "kernels compiled for any x86-64 (LLVM, generic)": {
        "NUMBA_CPU_NAME": "generic",
        "NUMBA_CPU_FEATURES": "",
    },
    "C library without AVX2 and fused multiply-add": {
        "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-AVX512F"
    },
}

INTRODUCTION = f"""## Reproducibility

The same seed gives bit-identical tracks for any number of cores, and for any instruction set that
the linear algebra, NumPy, OpenCV and the compiled kernels select: each was exchanged alone, on
{STEPS} steps of `{ROOM}`, rendered again. The one exception is the C library: its exponential
function differs in the last digit on processors without fused multiply-add (before about 2013).
Where two people meet, the last digit can change the identities, so means over several seeds are
more reliable than one run.

`python3 -m tests.manual --machines` makes this table again.
"""


def record() -> None:
    """Run everything, and keep what differed."""
    with tempfile.TemporaryDirectory() as name:
        usual = _digests({}, Path(name))
        rows = []
        for words, environment in EXCHANGED.items():
            other = _digests(environment, Path(name))
            differs = [key for key in usual if usual[key] != other.get(key)]
            rows.append({"exchanged": words, "compared": len(usual), "differ": len(differs)})
            rows[-1]["pictures differ"] = any(key.startswith("rendered") for key in differs)
            print(rows[-1], flush=True)
    FILE.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


def section() -> str:
    """The part of the page of results; empty without a record, which alone backs what it says."""
    if not FILE.is_file():
        return ""
    lines = ["| exchanged | arrays that differ | pictures |", "|---|---|---|"]
    for row in json.loads(FILE.read_text(encoding="utf-8")):
        pictures = "differ" if row["pictures differ"] else "same"
        lines.append(f"| {row['exchanged']} | {row['differ']} of {row['compared']} | {pictures} |")
    return "\n".join([INTRODUCTION, *lines])


def _digests(environment: dict[str, str], folder: Path) -> dict[str, Any]:
    kernels = folder / environment.get("NUMBA_CPU_NAME", "native")
    own = {**os.environ, **environment, "NUMBA_CACHE_DIR": str(kernels)}
    line = [sys.executable, "-m", "tests.manual.records.machines"]
    done = subprocess.run(line, check=True, cwd=ROOT, env=own, stdout=subprocess.PIPE)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def _found() -> Iterator[tuple[str, Any]]:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / ROOM
        render(ROOM, folder, frames=STEPS)
        for path in sorted(folder.iterdir()):
            yield f"rendered {path.name}", hashlib.sha256(path.read_bytes()).hexdigest()
        yield from of_run(pipeline.compute(read_sequence(folder), RunParameters())).items()


if __name__ == "__main__":
    if cores := os.environ.get("MACHINE_CORES"):
        os.sched_setaffinity(0, range(int(cores)))
    print(json.dumps(dict(_found())))
