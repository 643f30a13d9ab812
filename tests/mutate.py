"""Would the tests notice? Small changes of the engine, each of which a test must refuse.

``python -m tests.mutate [WORD]`` makes each change of ``mutants.toml`` in a copy of the tree,
never here, and runs the narrow tests that are named with it: they must pass without any change,
and at least one must fail with it. A change names a piece of text that is there exactly once;
where it is gone, that is reported, and the list is to be brought up to date.

``python -m tests.mutate --sample N --seed S [PACKAGE]`` draws N changes from the code itself and
runs the tests of the package that each belongs to and then those of whole runs, up to the first
that fails. Rows of the list with ``equivalent = "why"`` have no effect that a test could see: they
are never drawn.

Kernels are compiled for a sample alone: for the narrow tests of the list the interpreter is sooner
done.
"""

from __future__ import annotations

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from collections.abc import Iterator
from collections.abc import Sequence as Many
from concurrent.futures import ThreadPoolExecutor, as_completed
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from itertools import pairwise
from pathlib import Path
from queue import Queue
from typing import Any

from tests.conftest import DATA

ROOT = Path(__file__).resolve().parent.parent
LIST = Path(__file__).with_name("mutants.toml")
COPIED = ("tracker", "app", "static", "tests", "pyproject.toml")

SECONDS = 300.0
"""A change whose tests take longer than this has made something endless: it is killed."""

PASSED, FAILED, BROKEN = 0, 1, (2, 3, 4)
"""What pytest ends with; one that is broken cannot even import what it tests. A negative status is
the signal that ended it: a compiled kernel that leaves its arrays, say."""

PACKAGES = (
    "kernels", "filters", "fusion", "smoothing", "single_view", "evaluation", "corrections",
    "sequences", "geometry",
)  # fmt: skip
"""What a sample is drawn from where no package is named."""

TESTED_BY = {
    "kernels/pictures": ("kernels", "single_view"),
    "kernels/smoothing": ("kernels", "smoothing"),
    "kernels/association.py": ("kernels", "filters/test_association.py"),
    "kernels/lens.py": ("kernels", "geometry"),
    "kernels/consistency.py": ("kernels", "geometry"),
    "kernels": ("kernels", "filters"),
    "sequences/detectors.py": ("single_view/test_detector_fetching.py",),
    "sequences": ("sequences", "bad_input/test_table.py"),
    "geometry/consistency": ("geometry", "io/checks"),
    "steps": ("runs/test_steps.py", "runs/test_stage_files.py"),
}
"""Whose tests are not only in the folder of the same name; the first that fits counts."""

NOT_DRAWN = (
    "kernels/compilation.py",  # does nothing where kernels are not compiled
    "kernels/checked_cache.py",
)
WHOLE_RUNS = ("tests/golden",)
"""Who is asked of a drawn change that no test of its package notices."""
NOT_RUN = ("test_compilation.py", "test_checked_cache.py", "test_robustness.py")
"""Tests of compiled kernels alone, and of many or large pictures, which take long interpreted."""

SORTS = ("bound", "sign", "off by one", "factor", "swapped", "and/or", "negated")


def _joined(text: str) -> str:
    """The text with single spaces."""
    return " ".join(text.split())


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
    equivalent: str = ""
    """Why no test can notice it, where that is so."""

    @property
    def rounds(self) -> tuple[tuple[str, ...], ...]:
        """Tests that are run together."""
        return (self.tests,)

    def __str__(self) -> str:
        return f"{self.file}: {_joined(self.old)} → {_joined(self.new)}"

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


@dataclass(frozen=True)
class Drawn:
    """A change of one place in a file."""

    file: str
    sort: str
    start: int
    """Its first character in the file."""
    old: str
    new: str
    line: int
    """Counted from 1."""
    lines: tuple[str, str]
    """The whole line as it is and as it will be, with single spaces."""
    rounds: tuple[tuple[str, ...], ...] = ()
    """Tests that are run one after the other, until one fails."""

    def __str__(self) -> str:
        return f"{self.file}:{self.line} ({self.sort}) {self.lines[0]} → {self.lines[1]}"

    def text(self, root: Path) -> tuple[Path, str, str]:
        """The file, as it is and as it will be."""
        path = root / self.file
        before = path.read_text(encoding="utf-8")
        after = before[: self.start] + self.new + before[self.start + len(self.old) :]
        return path, before, after


def read(path: Path = LIST) -> list[Mutant]:
    """The list, those of no effect too."""
    rows = tomllib.loads(path.read_text(encoding="utf-8"))["mutant"]
    return [
        Mutant(r["file"], r["old"], r["new"], tuple(r.get("tests", ())), r.get("equivalent", ""))
        for r in rows
    ]


# ── what can be drawn


class _Changes(ast.NodeVisitor):
    """Collects every change of one file as (sort, first character, length, new text)."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.found: list[tuple[str, int, int, str]] = []
        # columns of a syntax tree count bytes
        self._lines = [line.encode() for line in source.splitlines(keepends=True)]
        self._starts = [0]
        for line in source.splitlines(keepends=True):
            self._starts.append(self._starts[-1] + len(line))

    def span(self, node: Any) -> tuple[int, int]:
        """First character of a node, and the one after its last."""
        places = ((node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset))
        start, end = (self._starts[n - 1] + len(self._lines[n - 1][:c].decode()) for n, c in places)
        return start, end

    def replace(self, sort: str, node: Any, new: str) -> None:
        """Another text for a node."""
        start, end = self.span(node)
        self.found.append((sort, start, end - start, new))

    def between(self, sort: str, left: Any, right: Any, old: str, new: str) -> None:
        """Another operator between two nodes."""
        start, end = self.span(left)[1], self.span(right)[0]
        place = re.search(rf"(?<![<>=*&|]){re.escape(old)}(?![<>=*&|])", self.source[start:end])
        if place:
            self.found.append((sort, start + place.start(), len(old), new))

    def wrapped(self, sort: str, node: Any, pattern: str = "not ({})") -> None:
        """A node with text around it."""
        start, end = self.span(node)
        self.replace(sort, node, pattern.format(self.source[start:end]))

    def swap(self, nodes: Many[Any]) -> None:
        """Neighbours exchanged."""
        for left, right in pairwise(nodes):
            (a, b), (c, d) = self.span(left), self.span(right)
            text = self.source
            if text[a:b] != text[c:d]:
                self.found.append(("swapped", a, d - a, text[c:d] + text[b:c] + text[a:b]))

    # annotations, messages and docstrings are no code
    def visit_Raise(self, node: ast.Raise) -> None: ...

    def visit_JoinedStr(self, node: ast.JoinedStr) -> None: ...

    def visit_Assert(self, node: ast.Assert) -> None: ...

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.visit(node.value)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        for part in (*node.args.defaults, *filter(None, node.args.kw_defaults), *node.body):
            self.visit(part)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        for part in node.body:
            self.visit(part)

    def visit_Compare(self, node: ast.Compare) -> None:
        other = {
            ast.Lt: ("<", "<="),
            ast.LtE: ("<=", "<"),
            ast.Gt: (">", ">="),
            ast.GtE: (">=", ">"),
        }
        sides = [node.left, *node.comparators]
        for left, operator, right in zip(sides, node.ops, sides[1:], strict=False):
            if type(operator) in other:
                self.between("bound", left, right, *other[type(operator)])
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        other = {
            ast.Add: ("sign", "+", "-"), ast.Sub: ("sign", "-", "+"),
            ast.Mult: ("factor", "*", "/"), ast.Div: ("factor", "/", "*"),
            ast.BitAnd: ("and/or", "&", "|"), ast.BitOr: ("and/or", "|", "&"),
        }  # fmt: skip
        if type(node.op) in other:
            sort, old, new = other[type(node.op)]
            self.between(sort, node.left, node.right, old, new)
        self.generic_visit(node)

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        other = {
            ast.Add: ("sign", "+=", "-="), ast.Sub: ("sign", "-=", "+="),
            ast.Mult: ("factor", "*=", "/="), ast.Div: ("factor", "/=", "*="),
            ast.BitAnd: ("and/or", "&=", "|="), ast.BitOr: ("and/or", "|=", "&="),
        }  # fmt: skip
        if type(node.op) in other:
            sort, old, new = other[type(node.op)]
            self.between(sort, node.target, node.value, old, new)
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        start, end = self.span(node.operand)
        sort = {ast.USub: "sign", ast.Not: "negated", ast.Invert: "negated"}.get(type(node.op))
        if sort:
            self.replace(sort, node, self.source[start:end])
        if not isinstance(node.operand, ast.Constant):
            self.visit(node.operand)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        words = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for left, right in pairwise(node.values):
            self.between("and/or", left, right, *words)
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        if type(node.value) is int:
            self.replace("off by one", node, str(node.value + 1))
            if node.value > 0:
                self.replace("off by one", node, str(node.value - 1))
        elif type(node.value) is float:
            self.replace("factor", node, repr(2.0 * node.value or 1.0))

    def visit_Slice(self, node: ast.Slice) -> None:
        for part in filter(None, (node.lower, node.upper)):
            if not isinstance(part, ast.Constant | ast.UnaryOp):
                self.wrapped("off by one", part, "{} - 1")
        self.generic_visit(node)

    def visit_Subscript(self, node: ast.Subscript) -> None:
        if isinstance(node.slice, ast.Tuple):
            self.swap(node.slice.elts)
        self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> None:
        if isinstance(node.func, ast.Name) and node.func.id == "range":
            for part in node.args:
                if not isinstance(part, ast.Constant):
                    self.wrapped("off by one", part, "{} - 1")
        if not any(isinstance(part, ast.Starred) for part in node.args):
            self.swap(node.args)
        self.generic_visit(node)

    def visit_condition(self, node: Any) -> None:
        self.wrapped("negated", node.test)
        self.generic_visit(node)

    visit_If = visit_While = visit_IfExp = visit_condition

    def visit_comprehension(self, node: ast.comprehension) -> None:
        for condition in node.ifs:
            self.wrapped("negated", condition)
        self.generic_visit(node)


def changes(root: Path, file: str) -> list[Drawn]:
    """Every change of a file that the sample draws from."""
    source = (root / file).read_text(encoding="utf-8")
    visitor = _Changes(source)
    visitor.visit(ast.parse(source))
    result = []
    for sort, start, length, new in sorted(set(visitor.found)):
        first = source.rfind("\n", 0, start) + 1
        last = source.find("\n", start + length)
        after = source[first:start] + new + source[start + length : last]
        lines = _joined(source[first:last]), _joined(after)
        line = source.count("\n", 0, start) + 1
        result.append(Drawn(file, sort, start, source[start : start + length], new, line, lines))
    return result


def modules(root: Path, packages: Many[str]) -> Iterator[str]:
    """The files of packages, or of single modules, that are drawn from."""
    for package in packages:
        place = root / "tracker" / package
        found = sorted(place.rglob("*.py")) if place.is_dir() else [place]
        if not all(path.is_file() for path in found) or not found:
            raise Unfit(f"tracker/{package}: there is no such package or module")
        for path in found:
            name = path.relative_to(root / "tracker").as_posix()
            if not name.startswith(NOT_DRAWN):
                yield f"tracker/{name}"


def tried_by(root: Path, file: str) -> tuple[tuple[str, ...], ...]:
    """The tests of a module: of its package those that import it and the others, whole runs."""
    name = file.removeprefix("tracker/")
    special = [key for key in TESTED_BY if name.startswith(key)]
    folders = TESTED_BY[special[0]] if special else (name.split("/")[0],)
    found: list[Path] = []
    for folder in folders:
        for place in (root / "tests" / folder, root / "tests" / "engine" / folder):
            found += sorted(place.rglob("test_*.py")) if place.is_dir() else []
            found += [place] if place.is_file() else []
    module = file.removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    package, _, last = module.rpartition(".")
    imports = re.compile(
        rf"(from|import) {re.escape(module)}\b|from {re.escape(package)} import [^\n]*\b{last}\b"
    )
    chosen = [path for path in found if path.name not in NOT_RUN]
    if not chosen:
        raise Unfit(f"{file}: there are no tests of its package")
    near: list[str] = []
    others: list[str] = []
    for path in chosen:
        imported = imports.search(path.read_text(encoding="utf-8"))
        (near if imported else others).append(path.relative_to(root).as_posix())
    return tuple(near), tuple(others), WHOLE_RUNS


def draw(root: Path, packages: Many[str], count: int, seed: int) -> list[Drawn]:
    """A sample of changes: every sort as often, and of a sort every place as likely."""
    harmless = {(m.file, _joined(m.old), _joined(m.new)) for m in read() if m.equivalent}
    places: dict[str, list[Drawn]] = {sort: [] for sort in SORTS}
    for file in modules(root, packages):
        for change in changes(root, file):
            places[change.sort].append(change)
    rng = random.Random(seed)
    chosen: list[Drawn] = []
    while len(chosen) < count and any(places.values()):
        sort = rng.choice([sort for sort in SORTS if places[sort]])
        change = places[sort].pop(rng.randrange(len(places[sort])))
        # one of no effect is replaced by the next draw; all others stay the same
        if (change.file, *change.lines) not in harmless:
            chosen.append(change)
    return [replace(one, rounds=tried_by(root, one.file)) for one in chosen]


# ── trying them


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


def outcome(
    root: Path, tests: tuple[str, ...], seconds: float = SECONDS, *, compiled: bool = False
) -> tuple[int, str]:
    """pytest's status in a copy of the tree, and what it printed."""
    environment = {
        **os.environ,
        "PYTHONPATH": str(root),
        "PYTHONDONTWRITEBYTECODE": "1",
        "NUMBA_DISABLE_JIT": "0" if compiled else "1",
        "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",  # a fifth of the time of a small test
        "OMP_NUM_THREADS": "1",
    }
    line = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider"]
    line += ["-m", "not browser"]  # which is no part of a package's own tests
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
def changed(mutant: Mutant | Drawn, root: Path) -> Iterator[None]:
    """The change, made in a copy of the tree and taken back."""
    path, before, after = mutant.text(root)
    path.write_text(after, encoding="utf-8")
    try:
        yield
    finally:
        path.write_text(before, encoding="utf-8")


def is_killed(
    mutant: Mutant | Drawn, copies: Queue[Path], seconds: float = SECONDS
) -> tuple[bool, float]:
    """Whether a test notices, and the seconds it took.

    Raises:
        Unfit: If the tests did not run.
    """
    root, begin = copies.get(), time.monotonic()
    drawn = isinstance(mutant, Drawn)
    try:
        status, printed = PASSED, ""
        with changed(mutant, root):
            for tests in filter(None, mutant.rounds):
                status, printed = outcome(root, tests, seconds, compiled=drawn)
                if status != PASSED:
                    break
    finally:
        copies.put(root)
    # a drawn change may be one that nobody can even import; one of the list may not
    killed = status == FAILED or status < 0 or (drawn and status in BROKEN)
    if status != PASSED and not killed:
        raise Unfit(f"{mutant}: pytest ended with {status}:\n{printed[-2000:]}")
    return killed, time.monotonic() - begin


def try_all(mutants: Many[Mutant | Drawn], workers: int) -> list[Mutant | Drawn]:
    """Try each, print what becomes of each, and return those that survive."""
    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(workers) as pool:
        copies: Queue[Path] = Queue()
        # the real recordings lie beside a tree
        (Path(folder) / DATA.parent.name).symlink_to(DATA.parent)
        for number in range(workers):
            copies.put(copy(Path(folder) / str(number)))
        for mutant in mutants:
            mutant.text(Path(folder) / "0")
        # what fails anyway would notice everything
        every = sorted({test for one in mutants for tests in one.rounds for test in tests})
        # none without a test: pytest would run them all
        shares = [tuple(every[number::workers]) for number in range(min(workers, len(every)))]
        roots = [Path(folder) / str(number) for number in range(len(shares))]
        begin = time.monotonic()
        limits = [len(every) * SECONDS] * len(shares)
        baseline = partial(outcome, compiled=any(isinstance(one, Drawn) for one in mutants))
        for status, printed in pool.map(baseline, roots, shares, limits):
            if status != PASSED:
                raise Unfit(f"the tests do not pass without a change:\n{printed[-4000:]}")
        # nothing that a change leaves alone takes so much longer than all of it together
        seconds = max(SECONDS, 3.0 * (time.monotonic() - begin) * workers)
        survivors = []
        trying = {pool.submit(is_killed, mutant, copies, seconds): mutant for mutant in mutants}
        for future in as_completed(trying):
            killed, taken = future.result()
            survivors += [] if killed else [trying[future]]
            word = "killed" if killed else "SURVIVED"
            print(f"{word} {taken:5.1f} s  {trying[future]}", flush=True)
    return survivors


def main() -> int:
    """All changes, those of files whose path holds a word, or a sample."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutate", description=__doc__)
    parser.add_argument(
        "words", nargs="*", help="only changes that hold one of these; of a sample: the packages"
    )
    parser.add_argument("--every", type=int, default=1, help="only one of so many of the list")
    parser.add_argument("--sample", type=int, default=0, help="draw so many changes")
    parser.add_argument("--seed", type=int, default=0, help="of the draw, or the first of --every")
    parser.add_argument("--workers", type=int, default=min(4, os.cpu_count() or 1))
    arguments = parser.parse_args()
    words, begin = arguments.words, time.monotonic()
    try:
        mutants: Many[Mutant | Drawn]
        if arguments.sample:
            mutants = draw(ROOT, words or PACKAGES, arguments.sample, arguments.seed)
        else:
            mutants = [
                mutant
                for mutant in read()
                if not mutant.equivalent and any(word in str(mutant) for word in words or [""])
            ][arguments.seed % arguments.every :: arguments.every]
        if not mutants:
            parser.error(f"{' '.join(words)}: no change of {LIST.name} holds this")
        survivors = try_all(mutants, max(1, min(arguments.workers, len(mutants))))
    except Unfit as error:
        print(error, file=sys.stderr)
        return 2
    for survivor in survivors:
        print(f"survived: {survivor}")
    seconds = time.monotonic() - begin
    drawn = f" drawn with seed {arguments.seed}" if arguments.sample else ""
    print(f"{len(mutants)} changes{drawn}, {len(survivors)} survived; {seconds:.0f} s")
    return 1 if survivors else 0


if __name__ == "__main__":
    sys.exit(main())
