"""YAML as calibrations are written in: plain data, OpenCV's dialect, and no references."""

from __future__ import annotations

import re
from typing import Any

import yaml


class _Loader(yaml.CSafeLoader):
    """Plain data only."""


def _matrix(loader: yaml.CSafeLoader, node: yaml.Node) -> Any:
    if not isinstance(node, yaml.MappingNode):
        raise ValueError("is not valid YAML (an opencv-matrix must have rows, cols, dt and data)")
    return loader.construct_mapping(node, deep=True)


for _kind in ("opencv-matrix", "opencv-nd-matrix"):
    _Loader.add_constructor(f"tag:yaml.org,2002:{_kind}", _matrix)


def parse_yaml(text: str, most_depth: int = 100) -> Any:
    """The first document of a YAML text.

    Raises:
        ValueError: If it is not YAML, refers, has tags of other programs or is too deep.
    """
    # OpenCV begins with "%YAML:1.0", which no other reader takes for a directive
    text = re.sub(r"\A%YAML[: ]\d\.\d\s*\n", "", text)
    # and its older versions leave no space after the colon of a key
    text = re.sub(r"^(\s*\w+):(?=[^\s:/\\])", r"\1: ", text, flags=re.MULTILINE)
    try:
        depth = 0
        for event in yaml.parse(text, Loader=yaml.CSafeLoader):
            if isinstance(event, yaml.AliasEvent):  # repeated, they make a short text endless
                raise ValueError("uses YAML references (&name, *name), expected plain values")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > most_depth:
                raise ValueError(f"has more than {most_depth} levels of nesting")
        loader: Any = _Loader(text)
        try:
            return loader.get_data() if loader.check_data() else None
        finally:
            loader.dispose()
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f"line {mark.line + 1}: " if mark is not None else ""
        problem = getattr(error, "problem", None) or "it cannot be parsed"
        raise ValueError(f"{place}is not valid YAML ({problem})") from None
