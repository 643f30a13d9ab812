"""Run the benchmarks and print a table.

It fails where a ratio of our own is below its bound, or a figure of accuracy is worse than the
last one on record by more than its tolerance; a speed that is worse beyond noise is only told.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from pathlib import Path

from tests.benchmarks import record, studies
from tests.benchmarks.engine import (
    accuracy,
    full_hd,
    growth,
    jpda,
    kernels,
    memory,
    pipeline,
    stage_one,
)
from tests.benchmarks.measure import Measurement, machine
from tests.benchmarks.plane import targets
from tests.benchmarks.record import chart
from tests.benchmarks.workbench import cold, kept, library, live, opening, page, server

SUITES = {
    "accuracy": accuracy.run,
    "cold": cold.run,
    "kernels": kernels.run,
    "targets": targets.run,
    "jpda": jpda.run,
    "pipeline": pipeline.run,
    "growth": growth.run,
    "memory": memory.run,
    "live": live.run,
    "stage_one": stage_one.run,
    "full_hd": full_hd.run,
    "server": server.run,
    "page": page.run,
    "opening": opening.run,
    "library": library.run,
    "kept": kept.run,
    "studies": studies.run,
    "crowd": studies.crowd,
}

LONG = ("full_hd",)
"""Renders videos for longer than it measures: the short form has it only where it is named."""


def main() -> int:
    """All suites or the named ones."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks", description=__doc__)
    parser.add_argument("names", nargs="*", choices=[*SUITES, []], help="suites; all if none")
    parser.add_argument("--short", action="store_true", help="the form that CI runs")
    parser.add_argument("--json", type=Path, help="also write the figures to this file")
    parser.add_argument("--record", action="store_true", help=f"append them to {record.FILE.name}")
    parser.add_argument("--chart", type=Path, help="only draw the record, as an HTML file")
    arguments = parser.parse_args()
    if arguments.chart:
        chart.write(record.read(), arguments.chart)
        return 0
    found: list[Measurement] = []
    chosen = [name for name in SUITES if name not in LONG or not arguments.short]
    for name in arguments.names or chosen:
        begin = time.monotonic()
        for measurement in SUITES[name](arguments.short):
            found.append(measurement)
            mark = "  FAILED" if measurement.failed else ""
            aim = f"  (aim {measurement.aim})" if measurement.aim else ""
            print(
                f"{measurement.name:<78} {measurement.value:>12.4g} {measurement.unit}{aim}{mark}",
                flush=True,
            )
        print(f"── {name}: {time.monotonic() - begin:.0f} s", flush=True)
    if arguments.json:
        report = {"machine": machine(), "figures": [m.as_dict() for m in found]}
        arguments.json.write_text(json.dumps(report, indent=1), encoding="utf-8")
    before = record.read()
    worse = list(record.losses(found, before))
    for sentence in record.slower(found, before, short=arguments.short):
        print(f"slower: {sentence}")
    for sentence in worse:
        print(f"WORSE: {sentence}")
    if arguments.record:
        record.append(record.entry(found, short=arguments.short))
        worse = []  # on purpose: it is in the record now
    return 1 if worse or any(measurement.failed for measurement in found) else 0


if __name__ == "__main__":
    sys.exit(main())
