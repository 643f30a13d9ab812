"""Everything that must hold, with one command: ``python3 -m tests``.

Needs nothing but Python 3.11 or newer: makes the environment ``.venv``, installs
the project and its test tools into it, then checks style, types and the import
rule and runs the tests and the short benchmarks. ``python3 -m tests --only tests
-- -k camera`` runs some of it; what follows ``--`` goes to pytest.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ENVIRONMENT = ROOT / ".venv"
NEEDS = {
    "page": "Node.js",
    "page style": "prettier 3",
    "page types": "TypeScript 5.5 or newer (tsc)",
}
BIN = ENVIRONMENT / ("Scripts" if os.name == "nt" else "bin")
PYTHON = BIN / ("python.exe" if os.name == "nt" else "python")


def set_up() -> None:
    """Make the environment and install the project, unless nothing has changed since."""
    if not PYTHON.exists():
        venv.EnvBuilder(with_pip=True).create(ENVIRONMENT)
    stamp = ENVIRONMENT / "installed-from"
    wanted = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    if stamp.exists() and stamp.read_text(encoding="utf-8") == wanted:
        return
    pip = [str(PYTHON), "-m", "pip", "install", "--quiet"]
    subprocess.run([*pip, "--editable", f"{ROOT}[test]"], check=True)
    # by itself: its own requirements bring a second OpenCV that clashes with the headless one
    subprocess.run([*pip, "--no-deps", "trackeval>=1.3"], check=True)
    stamp.write_text(wanted, encoding="utf-8")


def type_checker() -> str | None:
    """TypeScript's compiler, which reads the types in the page's comments, where it is at hand."""
    tsc = shutil.which("tsc")
    if tsc is None:
        return None
    told = subprocess.run([tsc, "--version"], capture_output=True, text=True).stdout
    version = [int(part) for part in told.split()[-1].split(".")[:2]]
    return tsc if version >= [5, 5] else None


def commands(pytest_arguments: list[str]) -> dict[str, list[list[str]]]:
    """What is run, by name, in order."""
    node, tsc, prettier = shutil.which("node"), type_checker(), shutil.which("prettier")
    page_tests = sorted(str(path) for path in (ROOT / "tests" / "page").glob("*.test.mjs"))
    return {
        "style": [
            [str(BIN / "ruff"), "check", "."],
            [str(BIN / "ruff"), "format", "--check", "."],
        ],
        "types": [[str(BIN / "mypy")]],
        "imports": [[str(BIN / "lint-imports")]],
        "page": [[node, "--test", *page_tests]] if node else [],
        "page style": [[prettier, "--check", "static", "tests/page"]] if prettier else [],
        "page types": [[tsc, "--project", str(ROOT / "static" / "jsconfig.json")]] if tsc else [],
        # at once for all processes that the tests start
        "kernels": [[str(PYTHON), "-m", "tracker.warm_up"]],
        "tests": [[str(PYTHON), "-m", "pytest", *pytest_arguments]],
        "benchmarks": [[str(PYTHON), "-m", "tests.benchmarks", "--short"]],
    }


def main() -> int:
    """Run all checks, tell every failure, and return 1 if there was one."""
    parser = argparse.ArgumentParser(prog="python3 -m tests", description=__doc__)
    names = list(commands([]))
    parser.add_argument("--only", action="append", choices=names, help="run only this, repeatable")
    parser.add_argument("pytest", nargs="*", help="arguments for pytest, after --")
    arguments = parser.parse_args()
    set_up()
    failed = []
    for name, lines in commands(arguments.pytest).items():
        if arguments.only and name not in arguments.only:
            continue
        if not lines:
            print(f"── {name}: skipped, {NEEDS[name]} is not installed", flush=True)
            continue
        begin = time.monotonic()
        print(f"── {name}", flush=True)
        for line in lines:
            if subprocess.run(line, cwd=ROOT).returncode != 0:
                failed.append(name)
        print(f"── {name}: {time.monotonic() - begin:.0f} s", flush=True)
    if failed:
        print(f"failed: {', '.join(dict.fromkeys(failed))}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
