"""Names are the field's words: what packages import from each other, and all of the packages done.

``NOT_DONE`` is what is left: a package leaves it when its own names are the field's too.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]

WORDS = (
    "told", "said", "ties", "stated", "seeker", "taken", "settled", "doubt", "doubts", "offers",
    "without_truth", "sight", "glimpse", "steadying", "restlessness", "hindsight", "looks",
    "placing", "theirs", "nobody", "somebody",
)  # fmt: skip
"""Words that a reader of this field would have to look up, as parts of names."""

OF_MODULES = ("checked", "visible")
"""Words that say nothing as the name of a module."""

NOT_DONE = {"io", "app"}
"""Packages whose inner names are not the field's yet."""

FILES = {
    ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for top in ("tracker", "app")
    for path in sorted((ROOT / top).rglob("*.py"))
}


def package_of(module: str) -> str:
    """The package that answers one question: below ``tracker``, or the whole workbench."""
    parts = module.split(".")
    return parts[1] if parts[0] == "tracker" and len(parts) > 1 else parts[0]


def word_in(name: str, words: tuple[str, ...] = WORDS) -> str | None:
    """The first of the words that is a part of a name: ``told`` of ``told_by_step``."""
    parts = "_".join(re.findall(r"[A-Z]?[a-z0-9]+|[A-Z]+", name)).lower()
    return next((word for word in words if f"_{word}_" in f"_{parts}_"), None)


def identifiers(tree: ast.AST) -> Iterator[str]:
    """All that is named or used in a file, but for what other packages' files name."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.arg):
            yield node.arg
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name


@pytest.mark.parametrize("name", ["told_by_step", "Doubt", "isSettled", "NOBODY", "_looks"])
def test_a_word_is_seen_as_part_of_a_name(name: str) -> None:
    assert word_in(name) is not None


@pytest.mark.parametrize("name", ["undoubted", "overlooks", "toldness", "insight", "properties"])
def test_a_word_inside_another_is_none(name: str) -> None:
    assert word_in(name) is None


def test_what_packages_import_from_each_other_is_named_in_the_fields_words() -> None:
    found, seen = [], 0
    for module, path in FILES.items():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            other = node.module or "" if isinstance(node, ast.ImportFrom) else ""
            if not other.startswith("tracker") or package_of(other) == package_of(module):
                continue
            assert isinstance(node, ast.ImportFrom)
            seen += len(node.names)
            found += [f"{module}: {one.name}" for one in node.names if word_in(one.name)]
    assert not found
    assert seen > 500


def test_modules_are_named_in_the_fields_words() -> None:
    names = [module.rpartition(".")[2] for module in FILES if module.startswith("tracker.")]
    assert not [name for name in names if word_in(name) or name in OF_MODULES]
    assert len(names) > 300


@pytest.mark.parametrize(
    "package", sorted({package_of(module) for module in FILES} - NOT_DONE - {"tracker"})
)
def test_a_package_that_is_done_uses_the_fields_words_alone(package: str) -> None:
    found = [
        f"{module}: {name}"
        for module, path in FILES.items()
        if package_of(module) == package
        for name in identifiers(ast.parse(path.read_text(encoding="utf-8")))
        if word_in(name)
    ]
    assert not found


def test_what_is_not_done_is_there_and_has_such_words() -> None:
    left = {
        package_of(module)
        for module, path in FILES.items()
        for name in identifiers(ast.parse(path.read_text(encoding="utf-8")))
        if word_in(name)
    }
    assert left == NOT_DONE
