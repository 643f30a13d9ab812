"""Render a room into an ordinary sequence folder, or the built-in sequences anew.

``python -m tests.rooms NAME|random-SEED -o FOLDER``; ``python -m tests.rooms ship`` writes the
three built-in sequences into the checkout.
"""

from __future__ import annotations

import argparse
import re
import sys
from pathlib import Path

from app.command.terminal import Bar
from tests.rooms import ROOMS, render, render_random
from tests.rooms.shipping import ship
from tracker.sequences import built_in

SHIP = "ship"


def main() -> int:
    """Render what is named; returns the exit status."""
    parser = argparse.ArgumentParser(prog="python -m tests.rooms", description=__doc__)
    parser.add_argument("name", help=f"one of {', '.join(ROOMS)}, random-SEED, or {SHIP}")
    parser.add_argument("-o", "--output", type=Path, metavar="FOLDER", help="must not exist yet")
    parser.add_argument(
        "--cameras", type=int, default=2, metavar="N", help="of a built-in room: 2 or 3"
    )
    parser.add_argument("--frames", type=int, metavar="N", help="only so many steps")
    given = parser.parse_args()
    if given.name == SHIP:
        for name in built_in.BUILT_IN:
            ship(name, built_in.ROOMS / name)
            print(f"written: {built_in.ROOMS / name}")
        return 0
    seeded = re.fullmatch(r"random-(\d{1,9})", given.name)
    if given.output is None or given.output.exists():
        parser.error("--output: expected a folder that does not exist")
    try:
        with Bar("rendering", "frame") as bar:
            if seeded:
                render_random(
                    int(seeded[1]), given.output, detections=True, frames=given.frames,
                    progress=bar.at,
                )  # fmt: skip
            else:
                render(
                    given.name, given.output, cameras=given.cameras, frames=given.frames,
                    progress=bar.at,
                )  # fmt: skip
    except ValueError as error:
        parser.error(str(error))
    return 0


if __name__ == "__main__":
    sys.exit(main())
