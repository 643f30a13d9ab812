"""A fixed sample of calls of the API in any order, with what fits and what does not."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.app.robustness import calls


@pytest.mark.full
@pytest.mark.parametrize(("which", "examples"), [(calls.EVERYTHING, 2), (calls.COMMANDS, 100)])
def test_no_call_makes_the_server_fail_or_answer_what_is_not_documented(
    which: tuple[str, ...], examples: int, tmp_path: Path
) -> None:
    found = calls.call(tmp_path, 1, which, examples)
    assert found.cases >= 100
    assert found.status == 0, found.said
