"""What a benchmark gives, and how it is timed."""

from __future__ import annotations

import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.metadata import version
from typing import Any, Literal

PACKAGES = ["numpy", "scipy", "numba", "opencv-python-headless", "fastapi", "viser"]


@dataclass(frozen=True, slots=True)
class Measurement:
    """One figure."""

    name: str
    value: float
    unit: str
    aim: str = ""
    """What it should reach, in words."""
    bound: float | None = None
    """For ratios of our own: the least value that passes."""
    better: Literal["higher", "lower"] | None = None
    """Which values are better; None: as the unit says, see :attr:`direction`."""
    tolerance: float | None = None
    """Of a figure of accuracy: by how much it may be worse than the last one on record, in its
    own unit. None for a figure of speed."""

    @property
    def failed(self) -> bool:
        """Whether a ratio fell below its bound."""
        return self.bound is not None and self.value < self.bound

    @property
    def direction(self) -> Literal["higher", "lower"]:
        """Which values are better: of times and sizes the lower, of ratios and rates the higher."""
        if self.better is not None:
            return self.better
        return (
            "higher" if self.unit.startswith(("×", "steps/s", "frames/s", "boxes/s")) else "lower"
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return asdict(self) | {"failed": self.failed}


def seconds(function: Callable[[], object], *, least: float = 0.3, runs: int = 5) -> float:
    """Median seconds of one call, warmed up, over runs of at least ``least`` seconds in all."""
    function()
    times = []
    begin = time.perf_counter()
    while len(times) < runs or time.perf_counter() - begin < least:
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return statistics.median(times)


def ratio(fast: Callable[[], object], slow: Callable[[], object], *, pairs: int = 5) -> float:
    """How many times faster the first is: the median over pairs run one after the other."""
    fast(), slow()
    ratios = []
    for _ in range(pairs):
        start = time.perf_counter()
        slow()
        between = time.perf_counter()
        fast()
        ratios.append((between - start) / (time.perf_counter() - between))
    return statistics.median(ratios)


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    return {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "system": platform.system(),
        "packages": {name: version(name) for name in PACKAGES},
    }
