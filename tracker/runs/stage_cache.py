"""A cache of the results of earlier runs' stages, for runs that share parameters with them.

The most recently used results are in memory, up to a number of bytes; those of stage 1, which
decodes pictures, are also on disk. A cached column is never modified: a run that takes it over
goes on from a copy that shares its blocks.
"""

from __future__ import annotations

import dataclasses
import threading
from collections import OrderedDict
from collections.abc import Callable
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
from tracker.steps import Steps

MEMORY_BYTES = 512 << 20
"""Memory for the columns of all runs and sequences together, bytes."""

_OBJECT_BYTES = 112
"""Overhead of an array or another object, bytes."""


@dataclass(frozen=True, slots=True, eq=False)
class ViewColumn:
    """The results of stage 1 of a run, from step 0 on."""

    steps: Steps[tuple[ViewResult, ...]]
    """The results of each step, one for each camera."""
    states: tuple[Any, ...] | None
    """The state of each camera's method after the last step, from which the stage can be
    continued; None where the column is complete."""
    from_pictures: bool
    """Whether pictures were decoded, so that the column is worth a file."""


@dataclass(frozen=True, slots=True, eq=False)
class FusionColumn:
    """The results of stage 2 of a run, from step 0 on."""

    steps: Steps[FusionResult]
    """The result of each step."""
    state: Any
    """The state of the filter after the last step."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackColumn:
    """The tracks of a run, of all steps."""

    tracks: Trajectories
    """The tracks of the run."""
    filtered: Trajectories
    """The tracks of the filter alone; the same object where nothing is smoothed."""


class IntermediateResults:
    """Cached intermediate results of smoothings that differ in corrections of identity alone."""

    def __init__(self, cache: StageCache, key: str) -> None:
        self._cache, self._key = cache, key

    def get(self, name: str) -> Any:
        """Return the result of this name; None if it is not cached."""
        return self._cache._get("smoothing", f"{self._key} {name}")

    def put(self, name: str, result: object) -> None:
        """Cache a result for later runs."""
        self._cache._put("smoothing", f"{self._key} {name}", result)


class StageCache:
    """Columns by the key of their stage. The cache is thread-safe."""

    def __init__(
        self,
        *,
        memory_bytes: int = MEMORY_BYTES,
        later_bytes: int | None = None,
        files: StageFiles | None = None,
        start: Callable[[Callable[[], object]], object] = lambda work: work(),
    ) -> None:
        """Start with an empty memory.

        Args:
            memory_bytes: Largest size of all columns in memory. The newest column of each stage
                stays whatever its size, so that the columns of the current run are available.
            later_bytes: Largest size of the columns of stages 2 and 3; None for no limit beside
                ``memory_bytes``.
            files: The files of finished columns of stage 1; None for memory only.
            start: Runs a function that writes a file: at once, or for instance in a thread.
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
        disk_bytes: int | None = None,
    ) -> StageCache:
        """Make a cache that also keeps files in the user's cache folder.

        Args:
            start: Runs a function that writes or deletes files.
            memory_bytes: Largest size of all columns in memory.
            disk_bytes: Largest size of all files; None for
                :func:`~tracker.files.folders.cache_bytes`. If earlier runs left more, the least
                recently used are deleted now.

        Raises:
            ValueError: If the limit in the environment is no size.
        """
        files = StageFiles(cache_folder() / "stages", disk_bytes)
        start(files.prune)
        return StageCache(memory_bytes=memory_bytes, files=files, start=start)

    @property
    def used_bytes(self) -> int:
        """The estimated memory of all columns, bytes."""
        return self._used

    def views(self, key: str, *, frames: int, cameras: int) -> ViewColumn | None:
        """Return stage 1 with this key, complete or not, from memory or from disk."""
        column: ViewColumn | None = self._get("single_view", key)
        if self._files is not None and (column is None or len(column.steps) < frames):
            steps = self._files.read(key, frames=frames, cameras=cameras)
            if steps is not None:
                column = ViewColumn(steps, None, from_pictures=True)
                self._put("single_view", key, column)
        return column

    def fusion(self, key: str) -> FusionColumn | None:
        """Return stage 2 with this key, complete or not."""
        column: FusionColumn | None = self._get("fusion", key)
        return column

    def smoothed(self, key: str) -> Smoothed | None:
        """Return stage 3 with this key, of all steps."""
        smoothed: Smoothed | None = self._get("smoothing", key)
        return smoothed

    def tracks(self, key: str) -> TrackColumn | None:
        """Return the tracks of a run with this key, of all steps."""
        tracks: TrackColumn | None = self._get("tracks", key)
        return tracks

    def intermediate(self, key: str) -> IntermediateResults:
        """Return the cache of intermediate results of stage 3, by the key they have in common."""
        return IntermediateResults(self, key)

    def keep_views(self, key: str, column: ViewColumn, *, complete: bool) -> None:
        """Keep stage 1, unless more steps of it are cached; a complete one is also put on disk."""
        before: ViewColumn | None = self._get("single_view", key)
        if before is None or len(before.steps) < len(column.steps):
            self._put("single_view", key, column)
            if complete and column.from_pictures and self._files is not None:
                files, steps = self._files, column.steps
                self._start(lambda: files.write(key, steps))

    def keep_fusion(self, key: str, column: FusionColumn) -> None:
        """Keep stage 2, unless more steps of it are cached."""
        before: FusionColumn | None = self._get("fusion", key)
        if before is None or len(before.steps) < len(column.steps):
            self._put("fusion", key, column)

    def keep_smoothed(self, key: str, smoothed: Smoothed) -> None:
        """Keep stage 3 of all steps."""
        if self._get("smoothing", key) is None:
            self._put("smoothing", key, smoothed)

    def keep_tracks(self, key: str, tracks: TrackColumn) -> None:
        """Keep the tracks of all steps."""
        if self._get("tracks", key) is None:
            self._put("tracks", key, tracks)

    def clear(self) -> None:
        """Drop all columns in memory."""
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
        """Store a column, and remove older ones until the limits of memory are kept."""
        weight = bytes_of(column)
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


def bytes_of(value: object) -> int:
    """Return the memory of a column: of all its arrays, each once, and about that of its objects.

    Args:
        value: A column, or another result of arrays, tuples and dataclasses.
    """
    return _bytes_of(value, set())


def _bytes_of(value: Any, seen: set[int]) -> int:
    """Return the size of a value in memory, bytes, without the objects that are counted already."""
    if id(value) in seen or value is None:
        return 0
    seen.add(id(value))
    if isinstance(value, ndarray | Steps):
        return int(value.nbytes) + _OBJECT_BYTES
    if isinstance(value, tuple | list):
        return _OBJECT_BYTES + sum(_bytes_of(one, seen) for one in value)
    if isinstance(value, dict):
        return _OBJECT_BYTES * (1 + len(value))
    if dataclasses.is_dataclass(value):
        fields = (getattr(value, field.name) for field in dataclasses.fields(value))
        return _OBJECT_BYTES + sum(_bytes_of(one, seen) for one in fields)
    return 32
