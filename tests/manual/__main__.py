"""Make what the manual says of the code and of the records anew: ``python3 -m tests.manual``.

``--record`` first runs experiments (all that are named, or every one) and keeps their tables,
from which alone the page of results is made; ``--keep`` takes what one has written; ``--sweeps``
runs short pieces over values of parameters, and keeps what the pictures of the page of tuning
show; ``--machines`` exchanges what differs between machines, one thing at a time; ``--pictures``
takes the pictures of the page.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from tests.conftest import DATA
from tests.manual.places import ROOT, made_pages
from tests.manual.records import machines, pictures, results, sweeps
from tests.papers.registry import EXPERIMENTS


def main() -> int:
    """Write the files that differ, and say which."""
    parser = argparse.ArgumentParser(prog="python3 -m tests.manual", description=__doc__)
    parser.add_argument(
        "--record", nargs="*", metavar="EXPERIMENT", choices=[*EXPERIMENTS, []], default=None
    )
    parser.add_argument(
        "--keep", nargs="+", type=Path, metavar="FILE", default=[],
        help="take what `python -m tests.papers` wrote into the records",
    )  # fmt: skip
    parser.add_argument("--sweeps", nargs="*", metavar="GROUP|KEY", default=None)
    parser.add_argument("--machines", action="store_true")
    parser.add_argument("--pictures", action="store_true")
    parser.add_argument("--data", type=Path, default=DATA, help="folder of the real recordings")
    arguments = parser.parse_args()
    if arguments.record is not None:
        results.record(arguments.record or list(EXPERIMENTS), arguments.data)
    for path in arguments.keep:
        results.keep(path)
    if arguments.sweeps is not None:
        sweeps.record(arguments.sweeps, arguments.data)
    if arguments.machines:
        machines.record()
    if arguments.pictures:
        pictures.record()
    for path, make in made_pages().items():
        text = make()
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")
            print(f"written: {path.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
