"""Machine code on disk that was damaged is compiled anew, and kept whole again."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
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
    return lambda: loaded(file)


def loaded(file: Path) -> Any:
    specification = importlib.util.spec_from_file_location("triples", file)
    assert specification is not None
    assert specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module.triple


def misses(kernel: Any) -> int:
    """How often it had to be compiled."""
    return sum(kernel.stats.cache_misses.values())


def test_what_is_whole_is_not_compiled_again(load: Callable[[], Any]) -> None:
    first, second = load(), load()
    assert first(2.0) == second(2.0) == 6.0
    assert (misses(first), misses(second)) == (1, 0)


def test_the_same_source_elsewhere_and_later_is_not_compiled_again(
    load: Callable[[], Any], tmp_path: Path
) -> None:
    """An installation in another folder has the machine code of one that was there before."""
    load()(2.0)
    source = tmp_path / "triples.py"
    elsewhere = tmp_path / "elsewhere" / source.name
    elsewhere.parent.mkdir()
    elsewhere.write_bytes(source.read_bytes())
    os.utime(elsewhere, (1.0, 1.0))
    triple = loaded(elsewhere)
    assert triple(2.0) == 6.0
    assert misses(triple) == 0


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
        *(flipped(at) for at in (0.0, 0.5, 1.0)),
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


COUNTED = """
import sys
sys.path.insert(0, sys.argv[1])
import squares
print("ready", flush=True)
sys.stdin.readline()
assert squares.outer(2.0) == 12.0
print(*(sum(each.stats.cache_misses.values()) for each in (squares.inner, squares.outer)))
"""


@pytest.mark.full
def test_of_two_processes_at_once_one_compiles(tmp_path: Path) -> None:
    """Both have imported the kernels before either is told to call them."""
    (tmp_path / "squares.py").write_text(
        "from tracker.kernels.compilation import compiled_later\n"
        "@compiled_later\ndef inner(x):\n    return 3.0 * x\n"
        "@compiled_later\ndef outer(x):\n    return inner(x) * x\n",
        encoding="utf-8",
    )
    both = [
        subprocess.Popen(
            [sys.executable, "-c", COUNTED, str(tmp_path)],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for _ in range(2)
    ]
    for process in both:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in both:
        assert process.stdin is not None
        process.stdin.write("\n")
        process.stdin.flush()
    misses = [process.communicate()[0].split() for process in both]
    assert [process.returncode for process in both] == [0, 0]
    assert sorted(misses) == [["0", "0"], ["1", "1"]]


LARGE = """
from math import sin
from tracker.kernels.compilation import compiled_later

@compiled_later
def large(x):
{lines}
    return x

@compiled_later
def caller(x):
    return large(x) + 1.0
"""

CALLED = """
import sys
sys.path.insert(0, sys.argv[1])
import many
print(many.caller(2.0) == many.caller.py_func(2.0) == many.large.py_func(2.0) + 1.0)
print(*(sum(each.stats.cache_misses.values()) for each in (many.large, many.caller)))
"""


@pytest.fixture
def called(tmp_path: Path) -> Callable[[], list[str]]:
    """A new process that calls the caller of a large kernel: whether its result is right, and how
    often the two were compiled."""
    lines = "\n".join(f"    x = sin(x * {number}.5) + {number}.25 / x" for number in range(500))
    (tmp_path / "many.py").write_text(LARGE.format(lines=lines), encoding="utf-8")

    def call() -> list[str]:
        done = subprocess.run(
            [sys.executable, "-c", CALLED, str(tmp_path)],
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels")},
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout.splitlines()

    return call


def stored(tmp_path: Path, name: str) -> list[Path]:
    return sorted((tmp_path / "kernels").rglob(f"many.{name}-*.nbc"))


@pytest.mark.full
def test_a_large_kernel_is_stored_once_and_its_caller_refers_to_it(
    called: Callable[[], list[str]], tmp_path: Path
) -> None:
    assert called() == ["True", "1 1"]
    (large,), (caller,) = stored(tmp_path, "large"), stored(tmp_path, "caller")
    assert caller.stat().st_size < large.stat().st_size / 3
    assert called() == ["True", "0 0"]


@pytest.mark.full
def test_a_caller_whose_large_kernel_was_lost_works_and_both_are_whole_again(
    called: Callable[[], list[str]], tmp_path: Path
) -> None:
    called()
    (large,) = stored(tmp_path, "large")
    large.write_bytes(b"")
    assert called() == ["True", "1 1"], "the kernel has another name now"
    assert called() == ["True", "0 0"]
