"""The pages of the API: one for each package of the engine, with every public module in it."""

from __future__ import annotations

import ast
import re
from pathlib import Path

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files

ROOT = Path(__file__).resolve().parents[3]
PACKAGE = "tracker"

_ROLE = re.compile(r":(?:func|class|attr|meth|mod|data|exc|const):<code>~?")


def modules() -> dict[str, list[str]]:
    """Every public module of the engine, by its package: the first below ``tracker``."""
    packages: dict[str, list[str]] = {}
    for path in sorted((ROOT / PACKAGE).rglob("*.py")):
        parts = list(path.relative_to(ROOT).with_suffix("").parts)
        if parts[-1] == "__init__":
            parts.pop()
        if any(part.startswith("_") for part in parts):
            continue
        own_package = len(parts) > 2 or path.name == "__init__.py"
        package = parts[1] if own_package and len(parts) > 1 else ""
        packages.setdefault(package, []).append(".".join(parts))
    return packages


def first_sentence(module: str) -> str:
    """What a module says that it is."""
    path = ROOT.joinpath(*module.split("."))
    # a folder may be left behind, with compiled files alone, where a module is a file now
    file = path.with_suffix(".py")
    file = file if file.exists() else path / "__init__.py"
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return " ".join(text.split("\n\n")[0].split())


def pages() -> dict[str, str]:
    """The Markdown of every page of the API, by its address."""
    packages = modules()
    made = {"api/index.md": _index(packages)}
    for package, names in packages.items():
        title = f"{PACKAGE}.{package}" if package else f"{PACKAGE}: modules of its own"
        body = "\n\n".join(f"::: {name}" for name in names)
        made[_page(package)] = f"# {title}\n\n{body}\n"
    return made


def _page(package: str) -> str:
    return f"api/{package or 'modules'}.md"


def _index(packages: dict[str, list[str]]) -> str:
    lines = [
        "# API",
        "",
        "The engine, `tracker`, is a library of its own: arrays in, arrays out, and neither web",
        "nor viewer. These pages are made from its docstrings, without running it. Start with",
        "[`tracker.runs.pipeline`](runs.md#tracker.runs.pipeline) and the",
        "[examples](../examples.md).",
        "",
        "The routes of a running workbench, with their types, are at `/docs` of its address.",
        "",
    ]
    for package, names in packages.items():
        lines += [
            f"## [{f'{PACKAGE}.{package}' if package else PACKAGE}]({_page(package)[4:]})",
            "",
        ]
        lines += ["| module | what it is |", "|---|---|"]
        for name in names:
            words = first_sentence(name).replace("|", "\\|")
            lines.append(f"| [`{name}`]({_page(package)[4:]}#{name}) | {words} |")
        lines.append("")
    return "\n".join(lines)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """MkDocs asks this first: the packages' pages go below the entry of the API."""
    for section in config.nav or []:
        for entries in section.values():
            for entry in entries if isinstance(entries, list) else []:
                if entry.get("API") == "api/index.md":
                    entry["API"] = list(pages())
    return config


def on_files(files: Files, *, config: MkDocsConfig) -> Files:
    """MkDocs asks this before it reads the pages."""
    for address, text in pages().items():
        files.append(File.generated(config, address, content=text))
    return files


def on_page_content(html: str, **_: object) -> str:
    """MkDocs asks this of every page: docstrings name things by the roles of Sphinx."""
    return _ROLE.sub("<code>", html)
