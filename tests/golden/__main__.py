"""Digests bit for bit, for a change that must change no number: write them, change, compare.

``python -m tests.golden --exact FILE`` before, ``python -m tests.golden --compare FILE``
after, on one machine with one set of libraries.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path
from typing import Any

from tests.conftest import DATA
from tests.golden.exact import digests


def difference(before: Any, after: Any) -> str | None:
    """What differs in one entry, in words; None where nothing does."""
    if before is None or after is None:
        return "only after" if before is None else "only before"
    if before == after:
        return None
    if isinstance(before, list) and isinstance(after, list):
        if len(before) != len(after):
            return f"{len(before)} steps before, {len(after)} after"
        wrong = [k for k, pair in enumerate(zip(before, after, strict=True)) if pair[0] != pair[1]]
        return f"from step {wrong[0]} on, {len(wrong)} of {len(before)} steps"
    return "differs"


def main() -> int:
    """Write the digests, or compare with those of a file: 1 where something differs."""
    parser = argparse.ArgumentParser(prog="python -m tests.golden", description=__doc__)
    way = parser.add_mutually_exclusive_group(required=True)
    way.add_argument("--exact", type=Path, metavar="FILE", help="write the digests into a file")
    way.add_argument("--compare", type=Path, metavar="FILE", help="say which differ from a file's")
    parser.add_argument("--only", default="", help="recordings and methods with this in their name")
    arguments = parser.parse_args()
    before: dict[str, dict[str, Any]] = {}
    if arguments.compare is not None:
        before = json.loads(arguments.compare.read_text(encoding="utf-8"))
    after: dict[str, dict[str, Any]] = {}
    entries = wrong = 0
    begin = time.monotonic()
    for name, found in digests(DATA, arguments.only):
        after[name] = dict(found)
        entries += len(found)
        if arguments.compare is not None:
            own = before.get(name, {})
            for field in [*own, *(set(found) - set(own))]:
                told = difference(own.get(field), found.get(field))
                if told is not None:
                    wrong += 1
                    print(f"{name} / {field}: {told}", flush=True)
    for name in before:
        if arguments.only in name and name not in after:
            wrong += 1
            print(f"{name}: only before", flush=True)
    if arguments.exact is not None:
        arguments.exact.write_text(json.dumps(after, indent=0), encoding="utf-8")
    seconds = time.monotonic() - begin
    print(f"{len(after)} runs and recordings, {entries} columns, {wrong} differ, {seconds:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
