"""Kernels are compiled once a machine, and machine code that was damaged is compiled anew."""

from __future__ import annotations

import ast
import importlib.util
import os
import shutil
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tracker.kernels import compilation


def python(code: str, cache: Path, **environment: str) -> str:
    """What a fresh interpreter prints, with a cache folder of its own."""
    inherited = {k: v for k, v in os.environ.items() if k != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        env={**inherited, "MULTIVIEW_PHD_CACHE": str(cache), **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout.strip()


USE = """
    import sys
    sys.path.insert(0, {folder!r})
    from tracker.kernels import compilation
    compiled = []
    import some_kernels
    with compilation.followed(lambda: compiled.append(1)):
        assert some_kernels.quadruple(3.0) == {result}
    print(len(compiled) > 0, compilation.counts(), compilation.without_signature())
"""


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A folder with two files of kernels, one of which calls the other's."""
    folder = tmp_path / "read-only"
    folder.mkdir()
    (folder / "other_kernels.py").write_text(
        "from tracker.kernels.compilation import kernel\n"
        "@kernel\ndef double(x):\n    return 2 * x\n",
        encoding="utf-8",
    )
    (folder / "some_kernels.py").write_text(
        "from tracker.kernels.compilation import kernel\n"
        "from other_kernels import double\n"
        "@kernel\n"
        "def quadruple(x):\n"
        "    return double(double(x))\n",
        encoding="utf-8",
    )
    return folder


@pytest.mark.full
def test_a_read_only_package_compiles_once(package: Path, tmp_path: Path) -> None:
    package.chmod(0o555)
    code = USE.format(folder=str(package), result=12.0)
    assert python(code, tmp_path / "cache").startswith("True (2, 2) []")
    assert python(code, tmp_path / "cache").startswith("False")
    assert not (package / "__pycache__" / "some_kernels.quadruple-3.py311.nbi").exists()
    assert list((tmp_path / "cache" / "kernels").rglob("*.nbi"))
    # another folder by numba's own variable
    own = {"NUMBA_CACHE_DIR": str(tmp_path / "own")}
    assert python(code, tmp_path / "cache", **own).startswith("True")
    assert python(code, tmp_path / "cache", **own).startswith("False")


def test_without_any_place_to_write_it_still_works(package: Path, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    code = USE.format(folder=str(package), result=12.0)
    assert python(code, tmp_path / "file").startswith("True")


@pytest.mark.parametrize(
    "importing",
    [
        "from tracker.b_kernels import x",
        "from tracker import b_kernels",
        "from tracker import (\n    b_kernels as b,\n)",
        "import tracker.b_kernels",
        "def late():\n    from tracker import b_kernels",
        "from tracker import \\\n    b_kernels",
        "from tracker import (  # what counts (and what does not)\n    b_kernels,\n)",
        "from tracker import b_kernels  # import of a neighbour",
        "if True: import tracker.b_kernels",
        "import os; import tracker.b_kernels",
        '"""Whoever reads this may\nimport what(ever) there is"""\nimport tracker.b_kernels',
    ],
)
def test_the_digest_follows_imports(
    importing: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = tmp_path / "tracker"
    root.mkdir()
    monkeypatch.setattr(compilation, "_ROOT", root)
    files = {
        "a_kernels.py": f"{importing}\n@kernel\ndef f(): ...\n",
        "b_kernels.py": "from tracker.plain import y\nfrom tracker.kernels.pairs import Pair\n"
        "from tracker.kernels.compilation import kernel\n@kernel\ndef g(): ...\n",
        "kernels/pairs.py": "class Pair(NamedTuple): ...\n",
        "kernels/compilation.py": "def kernel(): ...\n",
        "plain.py": "from tracker.c_kernels import z\n",
        "c_kernels.py": "@kernel\ndef h(): ...\n",
    }
    (root / "kernels").mkdir()
    for name, text in files.items():
        (root / name).write_text(text, encoding="utf-8")

    def digest() -> str:
        compilation._looked_at.cache_clear()
        known = compilation._with_used(root / "a_kernels.py", set())
        assert {path.name for path in known} == {"a_kernels.py", "b_kernels.py", "pairs.py"}
        return compilation._digest(known)

    before = digest()
    (root / "c_kernels.py").write_text("@kernel\ndef other(): ...\n", encoding="utf-8")
    assert digest() == before
    for name in ("b_kernels.py", "kernels/pairs.py"):
        (root / name).write_text(files[name] + "# changed\n", encoding="utf-8")
        assert digest() != before
        before = digest()


@pytest.mark.full
def test_imports_alone_tell_what_the_whole_file_tells() -> None:
    quick = 0
    for file in compilation._ROOT.rglob("*.py"):
        source = file.read_bytes()
        named = {
            name
            for node in ast.walk(ast.parse(source))
            if isinstance(node, ast.ImportFrom) and node.module
            for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        } | {
            alias.name
            for node in ast.walk(ast.parse(source))
            if isinstance(node, ast.Import)
            for alias in node.names
        }
        told = compilation._imported(source)
        assert set(told) == {name for name in named if name.split(".")[0] == "tracker"}, file
        matches = len(compilation._IMPORT.findall(source))
        quick += matches == len(compilation._IMPORT_WORD.findall(source))
    assert quick > 300  # else the short way is never taken


def test_what_was_not_used_for_long_is_deleted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    long_ago = time.time() - compilation._KEPT_SECONDS - 60.0
    for name in ("0123456789abcdef", "fedcba9876543210", "somebody-elses"):
        (tmp_path / name).mkdir()
    for name in ("0123456789abcdef", "somebody-elses"):
        os.utime(tmp_path / name, (long_ago, long_ago))
    assert not compilation.is_compiled()
    compilation.mark_compiled()
    assert compilation.is_compiled()
    left = sorted(path.name for path in tmp_path.iterdir() if path.is_dir())
    assert left == ["fedcba9876543210", "somebody-elses"]


@pytest.mark.full
def test_the_warm_up_calls_every_kernel_that_a_run_may_call() -> None:
    # in a fresh interpreter; what is read from disk brings the kernels that it calls with it
    code = """
        from tracker.runs import warm_up
        from tracker.kernels import compilation
        told = []
        for half in warm_up.HALVES:
            warm_up.compile_kernels(half, ready=lambda: told.append("ready"))
        assert told == ["ready"]
        kernels = {id(each.py_func): each.py_func for each in compilation._KERNELS}
        reached = {id(each.py_func) for each in compilation._KERNELS if each.signatures}
        open_ones = list(reached)
        while open_ones:
            function = kernels[open_ones.pop()]
            for name in function.__code__.co_names:
                called = getattr(function.__globals__.get(name), "py_func", None)
                if id(called) in kernels and id(called) not in reached:
                    reached.add(id(called))
                    open_ones.append(id(called))
        print(",".join(kernels[name].__name__ for name in kernels.keys() - reached))
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)], capture_output=True, text=True, check=True
    )
    # these are for those who use the engine as a library: no method of a run calls them
    library_only = {
        *("report", "allocate_weights", "subset_marginals"),
        *("cell_means", "_mean"),
        *("best_matchings", "assign", "augment"),
        *("disjoint_matchings", "_nearest", "_augment", "_push", "_pop"),
    }
    assert set(done.stdout.strip().split(",")) <= library_only


BY_HAND = """
    import sys
    sys.path.insert(0, {folder!r})
    from tracker.kernels import compilation
    import some_kernels
    compilation.while_compiling()
    assert some_kernels.quadruple(3.0) == 12.0
    print(compilation.counts())
    {then}
    assert some_kernels.quadruple(3.0) == 12.0
    print(compilation.counts())
"""


@pytest.mark.full
def test_while_another_process_compiles_a_kernel_runs_as_plain_python(
    package: Path, tmp_path: Path
) -> None:
    def counts(then: str) -> list[str]:
        return python(
            BY_HAND.format(folder=str(package), then=then), tmp_path / "cache"
        ).splitlines()

    assert counts("pass") == ["(0, 2)", "(0, 2)"]
    # what the other process has put on disk is used when it has told of it, and not before
    assert python(USE.format(folder=str(package), result=12.0), tmp_path / "cache")
    assert counts("pass") == ["(1, 2)", "(1, 2)"]
    assert counts("compilation.news_of_compiling()") == ["(1, 2)", "(1, 2)"]
    shutil.rmtree(tmp_path / "cache")
    assert counts("pass") == ["(0, 2)", "(0, 2)"]
    elsewhere = (
        "import subprocess; subprocess.run([sys.executable, '-c', "
        f'"import sys; sys.path.insert(0, {str(package)!r}); '
        'import some_kernels; some_kernels.quadruple(3.0)"], check=True)'
    )
    assert counts(elsewhere) == ["(0, 2)", "(0, 2)"]
    shutil.rmtree(tmp_path / "cache")
    assert counts(f"{elsewhere}; compilation.news_of_compiling()") == ["(0, 2)", "(1, 2)"]
    shutil.rmtree(tmp_path / "cache")
    # where the other process has failed, it is compiled here
    assert counts("compilation.no_longer_compiling()") == ["(0, 2)", "(2, 2)"]


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
