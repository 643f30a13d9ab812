"""Every example of the manual runs as it stands, from the top of its page to the bottom."""

from __future__ import annotations

import re
from typing import Any

import pytest

from tests.manual.places import PAGES

pytestmark = pytest.mark.full


def test_the_examples_run() -> None:
    text = (PAGES / "examples.md").read_text(encoding="utf-8")
    blocks = list(re.finditer(r"^```python\n(.*?)^```$", text, re.M | re.S))
    assert len(blocks) > 5
    names: dict[str, Any] = {}
    for block in blocks:
        line = text.count("\n", 0, block.start(1))
        # as many empty lines before, so that a failure names the line of the page
        exec(compile("\n" * line + block[1], str(PAGES / "examples.md"), "exec"), names)
