"""Every source that is cited is named in full where it is cited; every equation can be drawn."""

from __future__ import annotations

import re
from importlib.util import module_from_spec, spec_from_file_location

from tests.manual.places import MANUAL, PAGES, ROOT

KEY = re.compile(r"\[([A-Z][A-Za-z]*\d\d)\]")
"""As in ``[VM06]``."""


def test_every_file_names_the_sources_that_it_cites() -> None:
    cited = 0
    unnamed = {}
    for path in sorted(p for top in ("tracker", "app") for p in (ROOT / top).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        keys = set(KEY.findall(text))
        named = re.findall(r"(?m)^\s*(?:\"\"\")?\[([A-Z][A-Za-z]*\d\d)\] +[A-Z]", text)
        if keys - set(named):
            unnamed[str(path.relative_to(ROOT))] = keys - set(named)
        cited += len(keys)
    assert not unnamed
    assert cited > 20


def test_the_methods_name_the_sources_that_they_cite() -> None:
    text = (PAGES / "methods.md").read_text(encoding="utf-8")
    body, _, sources = text.partition("## Sources")
    assert set(KEY.findall(body)) == set(re.findall(r"(?m)^\[([A-Z]+\d\d)\]\n:   \w", sources))


def test_every_equation_is_drawn() -> None:
    """A command that the converter does not know stays as text, with its backslash."""
    spec = spec_from_file_location("equations", MANUAL / "hooks" / "equations.py")
    assert spec is not None
    assert spec.loader is not None
    equations = module_from_spec(spec)
    spec.loader.exec_module(equations)
    drawn = 0
    for path in PAGES.glob("*.md"):
        page = equations.on_page_markdown(path.read_text(encoding="utf-8"))
        for formula in re.findall(r"<math.*?</math>", page, flags=re.S):
            assert "\\" not in formula, f"{path.name}: {formula}"
            drawn += 1
    assert drawn > 40
