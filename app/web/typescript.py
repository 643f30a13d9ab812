"""The page's types of what the server sends, made from the models of the answers.

``python -m app.web.typescript`` writes ``static/js/types/server.d.ts`` anew; the compiler then
tells where the page still speaks of what is gone. JSON Schema of pydantic's *serialization*
mode says what an answer has: a field with a default is always there.
"""

from __future__ import annotations

import json
import sys
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from fastapi.routing import APIRoute
from pydantic import TypeAdapter

from app.paths import static_folder
from app.web.server import ROUTERS

LINE = 100
REFERENCE = "#/$defs/{model}"
HEAD = """\
/**
 * What the server sends, made from the models of its answers by `python -m app.web.typescript`.
 * Steps are 0-based; boxes are `[left, top, width, height]` in pixels; positions are metres.
 */
declare namespace Server {
"""
PLAIN = {"integer": "number", "number": "number", "string": "string", "boolean": "boolean"}


def declarations() -> str:
    """The file's text: one interface a model that a route answers with, or that is in one."""
    answers = [
        TypeAdapter(route.response_model)
        for router in ROUTERS
        for route in router.routes
        if isinstance(route, APIRoute) and route.response_model is not None
    ]
    _, schema = TypeAdapter.json_schemas(
        [(index, "serialization", answer) for index, answer in enumerate(answers)],
        ref_template=REFERENCE,
    )
    models: dict[str, dict[str, Any]] = schema["$defs"]
    return HEAD + "\n".join(_interface(name, models[name]) for name in sorted(models)) + "}\n"


def _interface(name: str, model: dict[str, Any]) -> str:
    needed = model.get("required", [])
    lines = [*_comment(model.get("description", ""), 1), f"\tinterface {name} {{"]
    for field, shape in model["properties"].items():
        lines += _comment(shape.get("description", ""), 2)
        lines.append(f"\t\t{field}{'' if field in needed else '?'}: {_type(shape)};")
    return "\n".join([*lines, "\t}", ""])


def _comment(text: str, indent: int) -> list[str]:
    """A documentation comment; one paragraph, since an editor shows it in a tip."""
    words = " ".join(text.split()).replace("*/", "*\\/")
    if not words:
        return []
    margin = "\t" * indent
    if len(words) + 2 * indent + 7 <= LINE:
        return [f"{margin}/** {words} */"]
    wrapped = textwrap.wrap(words, LINE - 2 * indent - 3)
    return [f"{margin}/**", *(f"{margin} * {line}" for line in wrapped), f"{margin} */"]


def _type(shape: dict[str, Any]) -> str:
    """TypeScript's word for a JSON schema."""
    if "$ref" in shape:
        return str(shape["$ref"]).rsplit("/", 1)[-1]
    if "const" in shape or "enum" in shape:
        return _union(json.dumps(value) for value in shape.get("enum", [shape.get("const")]))
    if "anyOf" in shape:
        return _union(_type(part) for part in shape["anyOf"])
    match shape.get("type"):
        case "null":
            return "null"
        case "array" if "prefixItems" in shape:
            return f"[{', '.join(map(_type, shape['prefixItems']))}]"
        case "array":
            inner = _type(shape.get("items", {}))
            return f"({inner})[]" if " | " in inner else f"{inner}[]"
        case "object":
            return _record(shape)
        case str(kind):
            return PLAIN[kind]
    return "any"


def _record(shape: dict[str, Any]) -> str:
    values = shape.get("additionalProperties", {})
    inner = _type(values) if isinstance(values, dict) else "any"
    names = _type(shape["propertyNames"]) if "propertyNames" in shape else "string"
    return f"Record<{names}, {inner}>"


def _union(words: Iterable[str]) -> str:
    return " | ".join(dict.fromkeys(words))


def main(folder: Path | None = None) -> int:
    """Write the file where the page has it."""
    path = (folder or static_folder()) / "js" / "types" / "server.d.ts"
    path.write_text(declarations(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
