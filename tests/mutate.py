"""Would the tests notice? Changes in the engine's hot lines, each of which a test must refuse.

``python -m tests.mutate`` makes each change of ``mutants.toml`` in a copy of the tree, never
here, and runs the narrow tests that are named with it: they must pass without any change, and
at least one must fail with it. A change names a piece of text that is there exactly once; where
it is gone, that is said, and the list is to be brought up to date. Kernels are not compiled
for this: on so few numbers the interpreter is sooner done.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from queue import Queue

ROOT = Path(__file__).resolve().parent.parent
LIST = Path(__file__).with_name("mutants.toml")
COPIED = ("tracker", "app", "static", "tests", "pyproject.toml")

SECONDS = 300.0
"""A change whose tests take longer than this has made something endless: it is noticed."""

PASSED, FAILED = 0, 1
"""What pytest ends with; anything else is a mistake in the list or in the tests themselves."""


class Unfit(Exception):
    """The list does not fit the code or the tests."""


@dataclass(frozen=True)
class Mutant:
    """One change, and who must notice it."""

    file: str
    old: str
    """A piece of the file's text that is there exactly once."""
    new: str
    tests: tuple[str, ...]
    """Files, or tests of files, as pytest names them."""

    def __str__(self) -> str:
        return f"{self.file}: {' '.join(self.old.split())} → {' '.join(self.new.split())}"

    def text(self, root: Path) -> tuple[Path, str, str]:
        """The file, as it is and as it will be.

        Raises:
            Unfit: If the piece of text is not there exactly once.
        """
        path = root / self.file
        before = path.read_text(encoding="utf-8") if path.is_file() else ""
        count = before.count(self.old)
        if count != 1:
            raise Unfit(f"{self}: expected the text once in the file, found it {count} times")
        return path, before, before.replace(self.old, self.new)


def read(path: Path = LIST) -> list[Mutant]:
    """The list."""
    rows = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    return [Mutant(r["file"], r["old"], r["new"], tuple(r["tests"])) for r in rows]


def copy(folder: Path) -> Path:
    """The tree as it is now, in another folder."""
    for name in COPIED:
        source, goal = ROOT / name, folder / name
        if source.is_dir():
            shutil.copytree(source, goal, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(source, goal)
    # compiled modules that are believed by what the source says: by its time, a change within
    # the same second would not be seen
    line = [sys.executable, "-m", "compileall", "-q", "--invalidation-mode", "checked-hash"]
    subprocess.run([*line, str(folder / "tracker"), str(folder / "tests")], check=True)
    return folder


def outcome(root: Path, tests: tuple[str, ...], seconds: float = SECONDS) -> tuple[int, str]:
    """pytest's status in a copy of the tree, and what it said."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_DISABLE_JIT": "1",
        "OMP_NUM_THREADS": "1",
    }
    line = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    # what overflows in compiled code does so silently
    line += ["-W", "ignore::RuntimeWarning", *tests]
    try:
        done = subprocess.run(
            line, cwd=root, env=environment, capture_output=True, text=True, timeout=seconds
        )
    except subprocess.TimeoutExpired:
        return FAILED, f"not done within {seconds:.0f} s"
    return done.returncode, done.stdout + done.stderr


@contextmanager
def changed(mutant: Mutant, root: Path) -> Iterator[None]:
    """The change, made in a copy of the tree and taken back."""
    path, before, after = mutant.text(root)
    path.write_text(after, encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(before, encoding="utf-8")


def dies(mutant: Mutant, copies: Queue[Path]) -> tuple[bool, float]:
    """Whether a test notices, and the seconds it took.

    Raises:
        Unfit: If the tests did not run.
    """
    root, begin = copies.get(), time.monotonic()
    try:
        with changed(mutant, root):
            status, said = outcome(root, mutant.tests)
    finally:
        copies.put(root)
    if status not in (PASSED, FAILED):
        raise Unfit(f"{mutant}: pytest ended with {status}:\n{said[-2000:]}")
    return status == FAILED, time.monotonic() - begin


def try_all(mutants: list[Mutant], workers: int) -> int:
    """Try each, tell of each, and return how many lived."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        copies: Queue[Path] = Queue()
        for number in range(workers):
            copies.put(copy(Path(folder) / str(number)))
        for mutant in mutants:
            mutant.text(Path(folder) / "0")
        # what fails anyway would notice everything
        every = sorted({test for mutant in mutants for test in mutant.tests})
        shares = [tuple(every[number::workers]) for number in range(workers)]
        roots = [Path(folder) / str(number) for number in range(workers)]
        for status, said in pool.map(outcome, roots, shares, [len(every) * SECONDS] * workers):
            if status != PASSED:
                raise Unfit(f"the tests do not pass without a change:\n{said[-4000:]}")
        lived = 0
        trying = {pool.submit(dies, mutant, copies): mutant for mutant in mutants}
        for future in as_completed(trying):
            died, seconds = future.result()
            lived += not died
            print(f"{'died' if died else 'LIVED'} {seconds:5.1f} s  {trying[future]}", flush=True)
    return lived


def main() -> int:
    """All changes, or those of files whose path holds a word."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutate", description=__doc__)
    parser.add_argument("word", nargs="?", default="", help="only changes that hold this")
    parser.add_argument("--workers", type=int, default=min(4, os.cpu_count() or 1))
    arguments = parser.parse_args()
    mutants = [mutant for mutant in read() if arguments.word in str(mutant)]
    begin = time.monotonic()
    try:
        lived = try_all(mutants, max(1, min(arguments.workers, len(mutants))))
    except Unfit as error:
        print(error, file=sys.stderr)
        return 2
    seconds = time.monotonic() - begin
    print(f"{len(mutants)} changes, {lived} of them not noticed; {seconds:.0f} s")
    return 1 if lived else 0


if __name__ == "__main__":
    sys.exit(main())
