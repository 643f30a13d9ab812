"""Run the benchmarks, print a table, and fail where a ratio of our own is below its bound."""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path

from tests.benchmarks import growth, jpda, kernels, live, page, pipeline, server, stage_one, targets
from tests.benchmarks.measure import Measurement, machine

SUITES = {
    "kernels": kernels.run,
    "targets": targets.run,
    "jpda": jpda.run,
    "pipeline": pipeline.run,
    "growth": growth.run,
    "live": live.run,
    "stage_one": stage_one.run,
    "server": server.run,
    "page": page.run,
}


def main() -> int:
    """All suites or the named ones."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*SUITES, []], help="suites; all if none")
    parser.add_argument("--short", action="store_true", help="the form that CI runs")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    arguments = parser.parse_args()
    found: list[Measurement] = []
    for name in arguments.names or SUITES:
        for measurement in SUITES[name](arguments.short):
            found.append(measurement)
            mark = "  FAILED" if measurement.failed else ""
            aim = f"  (aim {measurement.aim})" if measurement.aim else ""
            print(
                f"{measurement.name:<78} {measurement.value:>12.4g} {measurement.unit}{aim}{mark}",
                flush=True,
            )
    if arguments.json:
        report = {"machine": machine(), "figures": [m.as_dict() for m in found]}
        arguments.json.write_text(json.dumps(report, indent=1), encoding="utf-8")
    return 1 if any(measurement.failed for measurement in found) else 0


if __name__ == "__main__":
    sys.exit(main())
