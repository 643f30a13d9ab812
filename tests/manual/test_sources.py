"""Every source that a docstring or a page cites is named in full where it is cited."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.manual.places import PAGES, ROOT

KEY = re.compile(r"\[([A-Z][A-Za-z]*\d\d)\]")
"""As in ``[VM06]``."""

FILES = [
    path
    for folder in ("tracker", "app")
    for path in sorted((ROOT / folder).rglob("*.py"))
    if KEY.search(path.read_text(encoding="utf-8"))
]


def test_files_cite_sources() -> None:
    assert len(FILES) > 20


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(ROOT)))
def test_a_file_names_the_sources_that_it_cites(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    named = set(re.findall(r"(?m)^\s*(?:\"\"\")?\[([A-Z][A-Za-z]*\d\d)\] +[A-Z]", text))
    assert set(KEY.findall(text)) <= named


def test_the_methods_name_the_sources_that_they_cite() -> None:
    text = (PAGES / "methods.md").read_text(encoding="utf-8")
    body, _, sources = text.partition("## Sources")
    assert set(KEY.findall(body)) == set(re.findall(r"(?m)^\[([A-Z]+\d\d)\]\n:   \w", sources))
