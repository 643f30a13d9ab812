"""What the recipes of the page Contributing name is there, and their examples are true."""

from __future__ import annotations

import re
from importlib.util import find_spec
from typing import Annotated, Any

import pytest
from pydantic import Field

from app.web.server import ROUTERS
from tests.manual.places import PAGES, ROOT
from tests.manual.records import sweeps
from tracker.evaluation import DEFINITIONS, Definition, clear, evaluation
from tracker.evaluation.clear import Clear
from tracker.evaluation.matching import Comparison
from tracker.io.read.protocol import Format
from tracker.io.read.registry import FORMATS
from tracker.parameters import method as module
from tracker.parameters.catalogue import BUILT_IN, ENTRY_POINTS, PARAMETERS
from tracker.parameters.definition import Params, ui
from tracker.single_view import maker
from tracker.single_view.protocol import SingleViewMethod, ViewResult

PAGE = (PAGES / "contributing.md").read_text(encoding="utf-8")
NEW = ("my_tracker", "my_pane")
"""Files that whoever follows a recipe makes."""


def quoted() -> list[str]:
    """What stands in single backticks, on one line each."""
    prose = re.sub(r"```.*?```", "", PAGE, flags=re.S)
    return [" ".join(found.split()) for found in re.findall(r"`([^`]+)`", prose)]


def paths() -> list[str]:
    """Every path that the page names."""
    words = {word for part in quoted() for word in part.split()}
    return sorted(w for w in words if re.fullmatch(r"[a-z]\w*(/[\w.]+)+/?|[\w-]+/", w))


def test_every_path_is_there_and_what_a_recipe_makes_is_not() -> None:
    named = paths()
    assert {"tracker/parameters/catalogue.py", "static/js/main.js", "tests/page/"} <= set(named)
    new = [ROOT / path for path in named if any(word in path for word in NEW)]
    others = [ROOT / path for path in named if ROOT / path not in new]
    assert not [place for place in others if not place.exists()]
    assert not [place for place in new if place.exists() or not place.parent.is_dir()]


def test_every_module_that_is_run_is_there() -> None:
    modules = {name for part in quoted() for name in re.findall(r"python3? -m ([\w.]+)", part)}
    assert {"tests.manual", "app.web.typescript", "pytest"} <= modules
    for name in modules:
        assert find_spec(name) is not None, name


def test_every_name_is_there() -> None:
    for name in ("BUILT_IN", "FORMATS", "ROUTERS", "Params", "Method", "DEFINITIONS", "_score"):
        assert f"`{name}`" in PAGE
    assert DEFINITIONS
    assert evaluation._score
    assert BUILT_IN
    assert FORMATS
    assert ROUTERS
    assert "`multiview_phd.single_view`" in PAGE
    assert ENTRY_POINTS["single_view"] == "multiview_phd.single_view"
    asked = set(Format.__annotations__) | {"recognise", "read"}
    assert all(f"`{name}`" in PAGE for name in asked)
    for kind in (
        SingleViewMethod, ViewResult, module.Method, Format, Definition, Clear, Comparison,
    ):  # fmt: skip
        assert f"{kind.__module__}.{kind.__name__}" in PAGE


def test_the_example_of_a_parameter_is_one() -> None:
    found = re.search(r"```text\n(    shyness.*?)```", PAGE, flags=re.S)
    assert found is not None
    names: dict[str, Any] = {"Annotated": Annotated, "Field": Field, "ui": ui, "Params": Params}
    text = f"class Group(Params):\n{found.group(1)}"
    exec(compile(text, "contributing.md", "exec", dont_inherit=True), names)
    group = names["Group"]
    assert group().shyness == 0.5
    with pytest.raises(ValueError, match="less than or equal to 1"):
        group(shyness=2)


def test_the_example_of_a_description_is_one() -> None:
    found = re.search(r"```text\n    METHOD = (Method\(.*?\n    \))", PAGE, flags=re.S)
    assert found is not None
    names: dict[str, Any] = {**vars(module), "MyTrackerParams": Params}
    method = eval(re.sub(r"^    ", "", found.group(1), flags=re.M), names)
    assert method.own_group == "my_tracker"
    assert method.made_by is None
    with pytest.raises(ValueError, match="my_tracker: made_by names nothing"):
        maker(method)


def test_the_names_of_the_page_are_there() -> None:
    scripts = ROOT / "static" / "js"
    for name, script in (
        ("PLACES", "state/address.js"),
        ("TABS", "state/address.js"),
        ("TABLES", "inspector/tables.js"),
    ):
        assert f"`{name}`" in PAGE
        assert f"`static/js/{script}`" in PAGE
        assert f"const {name} =" in (scripts / script).read_text(encoding="utf-8")


def test_the_example_of_a_metric_is_one() -> None:
    found = re.search(r"```text\n    (Definition\(.*?\n)    ```", PAGE, flags=re.S)
    assert found is not None
    (metric,) = eval(f"({found.group(1)})", vars(clear).copy())
    first = clear.CLEAR[0]
    assert type(metric) is type(first)
    assert (metric.group, metric.settings) == (first.group, first.settings)
    assert metric.key not in {definition.key for definition in DEFINITIONS}


def test_sweeps_are_chosen_by_group_and_by_key() -> None:
    keys = [p.key for p in sweeps.chosen(["foreground", "fusion.clutter_rate"])]
    assert keys == [k for k in PARAMETERS if k.startswith("foreground.")] + ["fusion.clutter_rate"]
    assert sweeps.chosen([]) == list(PARAMETERS.values())
    with pytest.raises(ValueError, match=r"got fusion\.shyness"):
        sweeps.chosen(["fusion.shyness"])
