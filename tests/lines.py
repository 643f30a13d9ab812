"""Count the lines of the project: ``python -m tests.lines``.

A line of Python is code, docstring, comment or blank. A docstring is a string that stands alone as
a statement, so that one below an attribute counts too; a line that has code and a comment is code.
Of JavaScript and CSS every line counts, comments included.
"""

from __future__ import annotations

import ast
import io
import tokenize
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TOPS = ("tracker", "app", "tests")
KINDS = ("code", "docstrings", "comments", "blank")
APART = ("papers", "rooms", "compatibility")
"""Folders of ``tests`` that are no tests of the program: a total leaves them out."""


def kinds_of_lines(source: str) -> Counter[str]:
    """Number of lines of a Python source by kind."""
    lines = source.splitlines()
    docstrings = {
        number
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
        for number in range(node.lineno, (node.end_lineno or node.lineno) + 1)
    }
    comments = {
        token.start[0]
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip()
    }
    blank = {n for n, line in enumerate(lines, 1) if not line.strip()} - docstrings
    counts = {"docstrings": len(docstrings), "comments": len(comments), "blank": len(blank)}
    return Counter({"code": len(lines) - sum(counts.values()), **counts})


def count(root: Path) -> dict[str, Counter[str]]:
    """Lines of Python by package, as ``tracker/filters``; a module that lies directly in a top
    package counts there, as ``tracker``."""
    found: dict[str, Counter[str]] = {}
    for path in sorted(p for top in TOPS for p in (root / top).rglob("*.py")):
        package = "/".join(path.relative_to(root).parts[:-1][:2])
        found.setdefault(package, Counter()).update(kinds_of_lines(path.read_text("utf-8")))
    return found


def lines_of_page(root: Path) -> int:
    """All lines of JavaScript and CSS under ``static``."""
    files = [p for ending in ("js", "css") for p in (root / "static").rglob(f"*.{ending}")]
    return sum(len(p.read_text("utf-8").splitlines()) for p in files)


def table(root: Path) -> str:
    """Packages, then totals, as aligned columns."""
    found = count(root)

    def total(top: str, without: Iterable[str] = ()) -> Counter[str]:
        left_out = {f"{top}/{name}" for name in without}
        chosen = [c for p, c in found.items() if p.split("/")[0] == top and p not in left_out]
        return sum(chosen, Counter())

    rows = [*found.items()]
    rows += [(f"{top}, total", total(top)) for top in TOPS]
    rows += [(f"tests without {', '.join(APART)}", total("tests", APART))]
    width = max(len(name) for name, _ in rows)
    text = [" " * width + "".join(f"{kind:>12}" for kind in (*KINDS, "all"))]
    for name, counts in rows:
        numbers = (*(counts[kind] for kind in KINDS), counts.total())
        text.append(name.ljust(width) + "".join(f"{number:>12}" for number in numbers))
    text.append("static, JavaScript and CSS".ljust(width) + f"{lines_of_page(root):>60}")
    return "\n".join(text)


if __name__ == "__main__":
    print(table(ROOT))
