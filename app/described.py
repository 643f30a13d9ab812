"""Messages whose attribute docstrings are the descriptions of the OpenAPI page.

pydantic reads docstrings when a class is made, which for all messages together takes a tenth of
the program's start; here they are read when somebody asks for the description.
"""

from __future__ import annotations

import ast
import inspect
import sys
from collections.abc import Iterator
from functools import cache
from itertools import pairwise

from pydantic import BaseModel, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue
from pydantic_core import CoreSchema


class Described(BaseModel):
    """A message that is described by what stands below its attributes."""

    @classmethod
    def __get_pydantic_json_schema__(
        cls, core_schema: CoreSchema, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        """Its schema with a description of every attribute that has none of its own."""
        schema = handler(core_schema)
        properties = handler.resolve_ref_schema(schema).get("properties", {})
        for base in cls.__mro__:
            if issubclass(base, Described):
                for name, words in _docstrings(base).items():
                    if name in properties:
                        properties[name].setdefault("description", words)
        return schema


@cache
def _docstrings(cls: type) -> dict[str, str]:
    """What stands below each attribute of a class, by its name."""
    found = _classes(cls.__module__).get(cls.__qualname__)
    return {} if found is None else dict(_below(found.body))


def _below(body: list[ast.stmt]) -> Iterator[tuple[str, str]]:
    for one, following in pairwise(body):
        if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name):
            words = following.value if isinstance(following, ast.Expr) else None
            if isinstance(words, ast.Constant) and isinstance(words.value, str):
                yield one.target.id, inspect.cleandoc(words.value)


@cache
def _classes(module: str) -> dict[str, ast.ClassDef]:
    """The classes of a module; none where its source is not at hand."""
    try:
        tree = ast.parse(inspect.getsource(sys.modules[module]))
    except OSError:
        return {}
    return {node.name: node for node in tree.body if isinstance(node, ast.ClassDef)}
