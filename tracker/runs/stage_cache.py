"""The columns of earlier runs, so that going back to a value, or on from it, costs nothing.

In memory within a number of bytes, those used last; stage 1, which decodes pictures, also
on disk. What is kept is never changed: a run that takes a column over makes its own list.
"""

from __future__ import annotations

import dataclasses
import threading
from collections import OrderedDict
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from numpy import ndarray

from tracker.files.folders import cache_folder
from tracker.fusion.protocol import FusionResult
from tracker.fusion.trajectories import Trajectories
from tracker.parameters import Stage
from tracker.runs.stage_files import StageFiles
from tracker.single_view.protocol import ViewResult
from tracker.smoothing import Smoothed

MEMORY_BYTES = 512 << 20
"""Memory for the columns of all runs and sequences together."""

_OBJECT_BYTES = 112
"""Bytes of memory of an array or another object beside its content."""

_SAMPLED = 32
"""Steps of a column whose memory is counted; the others are taken to be as large."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewColumn:
    """Stage 1 of a run, from step 0 on."""

    steps: Sequence[tuple[ViewResult, ...]]
    states: tuple[Any, ...] | None
    """One a camera, to go on from; None where the column is complete."""
    costly: bool
    """Whether pictures were looked at: worth a file."""


@dataclass(frozen=True, slots=True, eq=False)
class FusionColumn:
    """Stage 2 of a run, from step 0 on."""

    steps: Sequence[FusionResult]
    state: Any


@dataclass(frozen=True, slots=True, eq=False)
class TrackColumn:
    """The people of a run, of all steps."""

    tracks: Trajectories
    filtered: Trajectories
    """As the filter alone has them; the same ones where nothing is smoothed."""


class Kept:
    """What smoothings that share a beginning found on their way, among the columns of a cache."""

    def __init__(self, cache: StageCache, key: str) -> None:
        self._cache, self._key = cache, key

    def get(self, what: str) -> Any:
        """Something that was kept, None where it is not there."""
        return self._cache._get("smoothing", f"{self._key} {what}")

    def put(self, what: str, found: object) -> None:
        """Keep something for later runs."""
        self._cache._put("smoothing", f"{self._key} {what}", found)


class StageCache:
    """Columns by the key of their stage. Thread-safe."""

    def __init__(
        self,
        *,
        memory_bytes: int = MEMORY_BYTES,
        later_bytes: int | None = None,
        files: StageFiles | None = None,
        start: Callable[[Callable[[], object]], object] = lambda work: work(),
    ) -> None:
        """Empty, but for the files.

        Args:
            memory_bytes: Bound on what is kept in memory. The newest column of each stage
                stays whatever its size, so that a run's own parts are always there.
            later_bytes: Of these at most so many for the stages after the first; None for all.
            files: For finished columns of stage 1; None for memory only.
            start: How a file is written: at once, or for instance in a thread.
        """
        self._limit = memory_bytes
        self._later_limit = memory_bytes if later_bytes is None else later_bytes
        self._files = files
        self._start = start
        self._used = self._later = 0
        self._kept: OrderedDict[tuple[Stage, str], tuple[Any, int]] = OrderedDict()
        self._lock = threading.Lock()

    @staticmethod
    def on_disk(
        start: Callable[[Callable[[], object]], object] = lambda work: work(),
        memory_bytes: int = MEMORY_BYTES,
    ) -> StageCache:
        """With files in the cache folder."""
        files = StageFiles(cache_folder() / "stages")
        return StageCache(memory_bytes=memory_bytes, files=files, start=start)

    @property
    def used_bytes(self) -> int:
        """Memory of all columns, by estimate."""
        return self._used

    def views(self, key: str, *, frames: int, cameras: int) -> ViewColumn | None:
        """Stage 1 with this key, as far as it was computed; from memory, else from disk."""
        column: ViewColumn | None = self._get("single_view", key)
        if self._files is not None and (column is None or len(column.steps) < frames):
            steps = self._files.read(key, frames=frames, cameras=cameras)
            if steps is not None:
                column = ViewColumn(steps, None, costly=True)
                self._put("single_view", key, column)
        return column

    def fusion(self, key: str) -> FusionColumn | None:
        """Stage 2 with this key, as far as it was computed."""
        column: FusionColumn | None = self._get("fusion", key)
        return column

    def smoothed(self, key: str) -> Smoothed | None:
        """Stage 3 with this key, of all steps."""
        smoothed: Smoothed | None = self._get("smoothing", key)
        return smoothed

    def tracks(self, key: str) -> TrackColumn | None:
        """The people of a run with this key, of all steps."""
        tracks: TrackColumn | None = self._get("tracks", key)
        return tracks

    def on_the_way(self, key: str) -> Kept:
        """What was found on the way to stage 3, by the key of what it begins with."""
        return Kept(self, key)

    def keep_views(self, key: str, column: ViewColumn, *, complete: bool) -> None:
        """Keep stage 1, unless more of it is there; a complete one on disk as well."""
        before: ViewColumn | None = self._get("single_view", key)
        if before is None or len(before.steps) < len(column.steps):
            self._put("single_view", key, column)
            if complete and column.costly and self._files is not None:
                files, steps = self._files, column.steps
                self._start(lambda: files.write(key, steps))

    def keep_fusion(self, key: str, column: FusionColumn) -> None:
        """Keep stage 2, unless more of it is there."""
        before: FusionColumn | None = self._get("fusion", key)
        if before is None or len(before.steps) < len(column.steps):
            self._put("fusion", key, column)

    def keep_smoothed(self, key: str, smoothed: Smoothed) -> None:
        """Keep stage 3 of all steps."""
        if self._get("smoothing", key) is None:
            self._put("smoothing", key, smoothed)

    def keep_tracks(self, key: str, tracks: TrackColumn) -> None:
        """Keep the people of all steps."""
        if self._get("tracks", key) is None:
            self._put("tracks", key, tracks)

    def clear(self) -> None:
        """Let go of everything in memory."""
        with self._lock:
            self._kept.clear()
            self._used = self._later = 0

    def _get(self, stage: Stage, key: str) -> Any:
        with self._lock:
            found = self._kept.get((stage, key))
            if found is None:
                return None
            self._kept.move_to_end((stage, key))
            return found[0]

    def _put(self, stage: Stage, key: str, column: Any) -> None:
        weight = weigh(column)
        with self._lock:
            self._take_out((stage, key))
            self._kept[stage, key] = column, weight
            self._count(stage, weight)
            newest = {stage: (stage, key) for stage, key in self._kept}
            for name in list(self._kept):
                is_later = name[0] != "single_view" and self._later > self._later_limit
                if (self._used > self._limit or is_later) and newest[name[0]] != name:
                    self._take_out(name)

    def _take_out(self, name: tuple[Stage, str]) -> None:
        self._count(name[0], -self._kept.pop(name, (None, 0))[1])

    def _count(self, stage: Stage, weight: int) -> None:
        self._used += weight
        if stage != "single_view":
            self._later += weight


def weigh(column: object) -> int:
    """Bytes of memory; of what has steps estimated from some of them."""
    if not isinstance(column, ViewColumn | FusionColumn):
        return _weight(column, set())
    every = max(1, len(column.steps) // _SAMPLED)
    sampled = [_weight(step, set()) for step in column.steps[::every]]
    return round(sum(sampled) * len(column.steps) / max(1, len(sampled)))


def _weight(value: Any, seen: set[int]) -> int:
    if id(value) in seen or value is None:
        return 0
    seen.add(id(value))
    if isinstance(value, ndarray):
        return int(value.nbytes) + _OBJECT_BYTES
    if isinstance(value, tuple | list):
        return _OBJECT_BYTES + sum(_weight(one, seen) for one in value)
    if isinstance(value, dict):
        return _OBJECT_BYTES * (1 + len(value))
    if dataclasses.is_dataclass(value):
        fields = (getattr(value, field.name) for field in dataclasses.fields(value))
        return _OBJECT_BYTES + sum(_weight(one, seen) for one in fields)
    return 32
