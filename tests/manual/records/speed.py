"""How fast the program is: the newest figures of the long form of the benchmarks on record."""

from __future__ import annotations

from tests.benchmarks import record

FIGURES = (
    ("GM-PHD filter, 100 targets, a step", "GM-PHD, 100 targets: step", "ms"),
    ("the same in Stone Soup", "GM-PHD, 100 targets: step, Stone Soup", "ms"),
    ("GM-PHD filter, 500 targets, a step", "GM-PHD, 500 targets: step", "ms"),
    ("the same in Stone Soup", "GM-PHD, 500 targets: step, Stone Soup", "ms"),
    ("GM-PHD filter, 1000 targets, a step", "GM-PHD, 1000 targets: step", "ms"),
    ("the same in Stone Soup", "GM-PHD, 1000 targets: step, Stone Soup", "ms"),
    ("OSPA of 100 targets over 40 steps", "GM-PHD, 100 targets: OSPA of 40 steps, components", "m"),
    (
        "the same in Stone Soup",
        "GM-PHD, 100 targets: OSPA of 40 steps, components, Stone Soup",
        "m",
    ),
    ("OSPA of 1000 targets over 2 steps", "GM-PHD, 1000 targets: OSPA of 2 steps, components", "m"),
    (
        "the same in Stone Soup",
        "GM-PHD, 1000 targets: OSPA of 2 steps, components, Stone Soup",
        "m",
    ),
    ("multi-Bernoulli filter, 10 targets, a step", "multi-Bernoulli, 10 targets: step", "ms"),
    ("multi-Bernoulli filter, 100 targets, a step", "multi-Bernoulli, 100 targets: step", "ms"),
    ("multi-Bernoulli filter, 1000 targets, a step", "multi-Bernoulli, 1000 targets: step", "ms"),
    (
        "`av163-seq30-2p-1101`, 500 steps of 3 cameras, from pictures to tracks",
        "pipeline on av163-seq30-2p-1101, 500 steps × 3 cameras",
        "times real time",
    ),
    (
        "four cameras of 1920×1080 with templates, decoding included",
        "4 cameras 1920×1080, colour_phd, decoding included",
        "steps/s",
    ),
    (
        "first start, kernels not compiled yet: first tracks",
        "cold start: the first tracks are there",
        "s",
    ),
    (
        "detection probability moved, 500 steps: the shown step, median",
        "drag of detection_probability, 500 steps: shown step, median",
        "ms",
    ),
    ("the same, 95 %", "drag of detection_probability, 500 steps: shown step, 95 %", "ms"),
    ("the whole run, median", "drag of detection_probability, 500 steps: whole run, median", "ms"),
    (
        "extraction threshold moved, 500 steps: the shown step, median",
        "drag of extraction_threshold, 500 steps: shown step, median",
        "ms",
    ),
    (
        "memory while tracking boxes of 3 cameras: filters",
        "cmc1 walked to and fro, 4000 to 20000 steps: private memory, stages 1 and 2",
        "kB a step",
    ),
    (
        "the same: smoothing",
        "cmc1 walked to and fro, 4000 to 20000 steps: private memory, smoothing",
        "kB a step",
    ),
    (
        "share of the time that two workers of a study compute",
        "studies: busy, 300 trials on 3 recordings, 2 workers",
        "",
    ),
)
"""What is printed: words, the figure's name on record, and its unit."""

INTRODUCTION = """## Speed

Measured by `python -m tests.benchmarks --record` on two cores of a shared virtual machine, whose
speed varies by a factor of two from hour to hour: a ratio within one day is meaningful, a
difference between days is not. Stone Soup filters the same measurements in the same run.
"""


def section() -> str:
    """The part of the page of results, of the newest entry that has each figure."""
    entries = [entry for entry in reversed(record.read()) if not entry.short]
    lines = ["| what | figure | measured on |", "|---|---|---|"]
    for words, name, unit in FIGURES:
        newest = next(entry for entry in entries if name in entry.speed)
        lines.append(f"| {words} | {newest.speed[name]:g} {unit}".rstrip() + f" | {newest.date} |")
    return "\n".join([INTRODUCTION, *lines, ""])
