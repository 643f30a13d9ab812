"""Machine code on disk that was damaged is compiled anew, and kept whole again."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

_SOURCE = """
from tracker.kernels.compilation import compiled_later

@compiled_later
def triple(x):
    return 3.0 * x
"""


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[], Any]:
    """The kernel, as a program that has just started has it."""
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "kernels"))
    file = tmp_path / "triples.py"
    file.write_text(_SOURCE, encoding="utf-8")

    def load() -> Any:
        specification = importlib.util.spec_from_file_location("triples", file)
        assert specification is not None
        assert specification.loader is not None
        module = importlib.util.module_from_spec(specification)
        specification.loader.exec_module(module)
        return module.triple

    return load


def misses(kernel: Any) -> int:
    """How often it had to be compiled."""
    return sum(kernel.stats.cache_misses.values())


def test_what_is_whole_is_not_compiled_again(load: Callable[[], Any]) -> None:
    first, second = load(), load()
    assert first(2.0) == second(2.0) == 6.0
    assert (misses(first), misses(second)) == (1, 0)


def flipped(at: float) -> Callable[[bytes], bytes]:
    """One bit of the content turned round."""

    def flip(content: bytes) -> bytes:
        place = int(at * (len(content) - 1))
        return content[:place] + bytes([content[place] ^ 0x10]) + content[place + 1 :]

    return flip


@pytest.mark.parametrize("suffix", ["nbi", "nbc"])
@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-1],
        lambda content: content[: len(content) // 2],
        lambda content: content[:20],
        lambda content: b"\0" * len(content),
        *(flipped(at) for at in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0)),
    ],
)
def test_what_was_damaged_is_compiled_anew_and_kept_whole(
    load: Callable[[], Any], tmp_path: Path, suffix: str, damage: Callable[[bytes], bytes]
) -> None:
    load()(2.0)
    (file,) = (tmp_path / "kernels").rglob(f"*.{suffix}")
    whole = file.read_bytes()
    file.write_bytes(damage(whole))
    again = load()
    assert again(2.0) == 6.0
    assert misses(again) == 1
    after = load()
    assert after(2.0) == 6.0
    assert misses(after) == 0, "it is whole again"
