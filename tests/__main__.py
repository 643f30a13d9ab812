"""Everything that must hold, with one command: ``python3 -m tests``.

Needs nothing but Python 3.11 or newer: makes the environment ``.venv``, installs
the project and its test tools into it, and checks style, types, the import rules,
every law and oracle, and the main job in a browser: in five to twelve minutes on two cores
the first time. ``python3 -m tests --all`` checks the rest as well: all of the
browser, processes, recordings, benchmarks and mutants; what has already
passed on these very files is not run again.

``python3 -m tests --fuzz 60`` damages recordings for an hour: whatever is done to their files,
the program must answer with a sentence or a sound run.

``python3 -m tests --only tests -- -k camera`` runs some of it; what follows ``--`` goes
to pytest. How long what takes is written in ``tests/README.md``.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import threading
import time
import tomllib
import venv
from collections.abc import Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
ENVIRONMENT = ROOT / ".venv"
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
PYTHON = str(BIN / ("python.exe" if os.name == "nt" else "python"))
STAMP = ENVIRONMENT / "installed-from"
PASSED = ENVIRONMENT / "passed"
"""A digest of the files on which the short form has passed."""

CORES = min(4, os.cpu_count() or 1)
WORKERS = CORES + 1
"""Processes that run tests side by side, one more than there are cores, since many wait for what
another process does; each takes up to a gigabyte. Those of the browser's tests have a core each: a
browser and its server keep one busy."""

FOR_KERNELS = (
    "jaxtyping", "numba", "numpy", "opencv-python-headless", "platformdirs", "pydantic", "pyyaml",
    "scipy", "typing-extensions",
)  # fmt: skip
"""What ``tracker.runs.warm_up`` imports: installed first, and the rest while it compiles."""

WAITING = ("nice", "-n", "19") if shutil.which("nice") else ()
"""What runs on what others leave of the processor: in the full form many tests wait for a process
that starts or ends, for a page, or for what must not happen for seconds."""

SHORT = "not full and not long"
FULL = "full and not browser"
BROWSER = "full and browser"

NO_TESTS = 5
"""Status of pytest where it finds no test."""


@dataclass(frozen=True)
class Check:
    """Commands that must all end well."""

    name: str
    lines: tuple[tuple[str, ...], ...]
    missing: str = ""
    """What is not installed, where it cannot be run for that."""
    may_be_empty: bool = False
    """Whether it has passed where pytest finds no test, as with the path of other tests."""

    def run(self, *, shown: bool = False) -> bool:
        """Run it, and tell what it said where it failed or where that is asked for."""
        if self.missing:
            tell(f"── {self.name}: skipped, {self.missing} is not installed")
            return True
        begin, said, failed = time.monotonic(), "", False
        if shown:
            tell(f"── {self.name}")
        for line in self.lines:
            how = None if shown else subprocess.PIPE
            done = subprocess.run(
                line, cwd=ROOT, stdout=how, stderr=subprocess.STDOUT if how else None, text=True
            )
            said += done.stdout or ""
            passed = (0, NO_TESTS) if self.may_be_empty else (0,)
            failed = failed or done.returncode not in passed
        words = f"── {self.name}: {'FAILED after ' if failed else ''}"
        tell(f"{said if failed else ''}{words}{time.monotonic() - begin:.0f} s")
        return not failed


_telling = threading.Lock()


def tell(words: str) -> None:
    """One piece of output, whole."""
    with _telling:
        print(words, flush=True)


@contextmanager
def installing() -> Iterator[None]:
    """Make the environment and install the project, unless nothing has changed since.

    Within it is there what the kernels are compiled with; all else is when it is left.
    """
    if not Path(PYTHON).exists():
        venv.EnvBuilder(with_pip=True).create(ENVIRONMENT)
    wanted = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    if STAMP.exists() and STAMP.read_text(encoding="utf-8") == wanted:
        yield
        return
    begin = time.monotonic()
    # compiled when imported: the tests import a small part of what is installed
    pip = [PYTHON, "-m", "pip", "install", "--quiet", "--no-compile"]
    subprocess.run([*pip, *of_kernels()], check=True)
    yield
    subprocess.run([*pip, "--editable", str(ROOT)], check=True)
    subprocess.run([*pip, *requirements("test")], check=True)  # the project is there
    # by itself: its own requirements bring a second OpenCV that clashes with the headless one
    subprocess.run([*pip, "--no-deps", "trackeval>=1.3"], check=True)
    STAMP.write_text(wanted, encoding="utf-8")
    tell(f"── installation: {time.monotonic() - begin:.0f} s")


def project_table() -> dict[str, Any]:
    """What the project says of itself."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    found: dict[str, Any] = tomllib.loads(text)["project"]
    return found


def of_kernels() -> list[str]:
    """Those of the project's requirements that its kernels are compiled with."""
    return [r for r in project_table()["dependencies"] if re.split(r"[=<>]", r)[0] in FOR_KERNELS]


def requirements(extra: str) -> list[str]:
    """What an extra of the project brings, those that it names in their turn too."""
    project = project_table()
    found: list[str] = []
    for one in project["optional-dependencies"][extra]:
        own = re.fullmatch(rf"{project['name']}\[([\w,-]+)\]", one)
        found += [r for name in own[1].split(",") for r in requirements(name)] if own else [one]
    return found


def install() -> None:
    """All of it."""
    with installing():
        pass


@cache
def type_checker() -> str | None:
    """TypeScript's compiler, which reads the types in the page's comments, where it is at hand."""
    tsc = shutil.which("tsc")
    if tsc is None:
        return None
    told = subprocess.run([tsc, "--version"], capture_output=True, text=True).stdout
    version = [int(part) for part in told.split()[-1].split(".")[:2]]
    return tsc if version >= [5, 5] else None


def page_checks() -> list[Check]:
    """What needs nothing of the environment."""
    node, tsc, prettier = shutil.which("node"), type_checker(), shutil.which("prettier")
    scripts = sorted(str(path) for path in (ROOT / "tests" / "page").glob("*.test.mjs"))
    types = ("--project", str(ROOT / "static" / "jsconfig.json"))
    return [
        Check("page", ((node or "", "--test", *scripts),), "" if node else "Node.js"),
        Check(
            "page style",
            ((prettier or "", "--check", "static", "tests/page"),),
            "" if prettier else "prettier 3",
        ),
        Check(
            "page types",
            ((tsc or "", *types),),
            "" if tsc else "TypeScript 5.5 or newer (tsc)",
        ),
    ]


def code_checks() -> list[Check]:
    """What reads the code, and does not run it."""
    ruff = str(BIN / "ruff")
    return [
        Check("style", ((ruff, "check", "."), (ruff, "format", "--check", "."))),
        Check("types", ((str(BIN / "mypy"),),)),
        Check("imports", ((str(BIN / "lint-imports"),),)),
    ]


def test_runs(arguments: list[str]) -> dict[str, Check]:
    """The tests: the short form, and what it leaves out, without a browser and with one."""
    line = (PYTHON, "-m", "pytest", "--dist", "worksteal")
    return {
        name: Check(
            name,
            ((*line, "-n", str(workers), "-m", marked, *arguments),),
            may_be_empty=bool(arguments) and marked != SHORT,
        )
        for name, workers, marked in (
            ("tests", WORKERS, SHORT),
            ("full tests", WORKERS, FULL),
            ("browser tests", CORES, BROWSER),
        )
    }


def fuzzing(minutes: float, *how: str, workers: int = CORES) -> tuple[str, ...]:
    """Damaged recordings for some minutes, other ones each time."""
    return (PYTHON, "-m", "tests.bad_input", f"{minutes:g}", "--workers", str(workers), *how)


def digest() -> str:
    """Of all files that a check may read."""
    found = hashlib.sha256(sys.version.encode())
    folders = [ROOT / name for name in ("app", "tracker", "static", "tests", ".ci")]
    files = [path for folder in folders for path in folder.rglob("*")]
    for path in sorted([*files, *ROOT.glob("*.*")]):
        if path.is_file() and "__pycache__" not in path.parts:
            found.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def already_passed() -> bool:
    """Whether the short form has passed on these files."""
    return PASSED.is_file() and PASSED.read_text(encoding="utf-8") == digest()


def in_order(checks: Iterable[Check]) -> list[str]:
    """Run some checks one after the other; the names of those that failed."""
    return [check.name for check in checks if not check.run()]


def main() -> int:
    """Run the checks, tell every failure, and return 1 if there was one."""
    # else each process compiles all that it imports again, installed packages too
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # each process has a core: threads that wait for each other there cost a fifth more
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    page, code = page_checks(), code_checks()
    # once for all processes that run tests: each would compile all modules again
    collected = Check(
        "collection", ((PYTHON, "-m", "pytest", "--collect-only", "-q", "-m", SHORT),)
    )
    # at once for all processes that the tests start
    kernels = Check("kernels", ((PYTHON, "-m", "tracker.runs.warm_up"),))
    benchmarks = Check("benchmarks", ((PYTHON, "-m", "tests.benchmarks", "--short"),))
    always = ("--seed", "20261122")  # the same cases; --fuzz draws others each time
    # beside the full form, whose tests leave some of both cores
    checked = (*WAITING, *fuzzing(0.0, *always, "--bounds", workers=1))
    checked_kernels = Check("kernels that check their indices", (checked,))
    # these three go side by side with the benchmarks, which keep one core busy
    third = str(int(digest()[:8], 16))  # another one with every change of a file
    every_third = ("tests.mutate", "--workers", "1", "--every", "3", "--seed", third)
    mutants = Check("mutants", ((*WAITING, PYTHON, "-m", *every_third),))
    fuzz = Check("fuzz", (fuzzing(1.4, *always, "--imports", workers=1),))
    bounds = Check("bounds", (fuzzing(0.7, *always, "--bounds", workers=1),))
    names = [check.name for check in (*page, *code, kernels, *test_runs([]).values())]

    parser = argparse.ArgumentParser(
        prog="python3 -m tests",
        description=__doc__,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--all", action="store_true", help="also what takes long")
    parser.add_argument(
        "--only",
        action="append",
        choices=[*names, benchmarks.name, mutants.name, fuzz.name, bounds.name],
        help="run only this, repeatable",
    )
    parser.add_argument(
        "--fuzz", type=float, metavar="MINUTES", help="only damage recordings, for so long"
    )
    parser.add_argument("pytest", nargs="*", help="arguments for pytest, after --")
    arguments = parser.parse_args()
    only: list[str] = arguments.only or []
    tests, *longer_tests = test_runs(arguments.pytest).values()

    if arguments.fuzz is not None:
        install()
        longer = Check("fuzz", (fuzzing(arguments.fuzz),))
        failed = [] if longer.run(shown=True) else [longer.name]
    elif only:
        install()
        everything = [
            *page, *code, kernels, tests, *longer_tests, benchmarks, mutants, fuzz, bounds
        ]  # fmt: skip
        failed = [c.name for c in everything if c.name in only and not c.run(shown=True)]
    else:
        failed = []
        if arguments.all and STAMP.exists() and already_passed():
            tell("── what `python3 -m tests` checks has passed on these files")
        else:
            before = digest()
            with ThreadPoolExecutor(3) as lanes:
                reading = lanes.submit(in_order, page)
                with installing():
                    compiling = lanes.submit(kernels.run)
                # types keep one core busy for a minute: the tests do not wait for them
                checking = lanes.submit(in_order, code)
                failed += in_order([collected])
                failed += [] if compiling.result() else [kernels.name]
                failed += [] if tests.run(shown=True) else [tests.name]
                failed += reading.result() + checking.result()
            if not failed and not arguments.pytest:
                PASSED.write_text(before, encoding="utf-8")
        if arguments.all:
            with ThreadPoolExecutor(1) as lane:
                checking = lane.submit(in_order, [checked_kernels])
                failed += [one.name for one in longer_tests if not one.run(shown=True)]
                timed = lane.submit(in_order, [bounds, fuzz, mutants])
                failed += [] if benchmarks.run(shown=True) else [benchmarks.name]
                failed += checking.result() + timed.result()
    if failed:
        print(f"failed: {', '.join(dict.fromkeys(failed))}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
