"""The packages and who may import whom, from the import contracts."""

from __future__ import annotations

import ast
import re
import tomllib
from pathlib import Path
from typing import Any

from tests.manual.places import PAGES, ROOT, between


def page() -> str:
    """The page of the architecture with its packages made anew."""
    text = (PAGES / "architecture.md").read_text(encoding="utf-8")
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = settings["tool"]["importlinter"]["contracts"]
    return between(text, "packages", "\n\n".join(map(_section, contracts)))


def _section(contract: dict[str, Any]) -> str:
    title = f"### {contract['name']}\n\n"
    if contract["type"] != "layers":
        sources, others = (_listed(contract[k]) for k in ("source_modules", "forbidden_modules"))
        return f"{title}{sources} imports none of {others}."
    container = contract.get("containers", [""])[0]
    lines = [
        "Each line may import what stands below it.",
        "",
        "| package | what it is |",
        "|---|---|",
    ]
    for layer in contract["layers"]:
        names = [f"{container}.{one}".lstrip(".") for one in re.split(r" [|:] ", layer)]
        words = "<br>".join(f"`{name}`: {_purpose(name)}" for name in names)
        lines.append(f"| {_listed(name.rpartition('.')[2] for name in names)} | {words} |")
    return title + "\n".join(lines)


def _listed(names: Any) -> str:
    return ", ".join(f"`{name}`" for name in names)


def _purpose(name: str) -> str:
    """The first sentence of a package's or module's docstring."""
    path = ROOT.joinpath(*name.split("."))
    file: Path = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.partition("\n\n")[0].split()).replace("|", "\\|")
