"""The reader of a sequence's pictures: exact frames of any camera, in any order, from any thread.

Scrubbing reads steps out of order, playback reads one after the other, and the pipeline reads all.
The first two share a cache of bounded size, which a thread fills ahead of the playback; the
pipeline has a decoder of its own.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol, TypeVar

from jaxtyping import UInt8
from numpy import ndarray

from tracker.sequences.pictures.video import VideoDecoder, VideoError, index_video, read_image
from tracker.sequences.sequence import Sequence, View

_Made = TypeVar("_Made")

Picture = UInt8[ndarray, "h w 3"]

CACHE_BYTES = 256 * 2**20
"""Memory for decoded pictures of all cameras, bytes: about 800 of 360x288."""

AHEAD = 24
"""The number of steps that are decoded ahead of playback, about a second."""

BEHIND = 12
"""The number of earlier steps that are cached during backward playback."""

NEAR = 4
"""Largest distance between requested steps that is playback rather than a jump."""


class Pictures(Protocol):
    """The reader of pictures that methods of stage 1 use, for instance a :class:`FrameReader`."""

    def picture(self, camera: int, step: int) -> Picture | None:
        """Return the picture of one camera at one step, BGR; None if there is none."""
        ...

    def iterate(self, camera: int, first: int = 0) -> Iterator[Picture | None]:
        """Yield the pictures of one camera from one step to the last."""
        ...

    def empty(self, camera: int) -> Picture | None:
        """Return the picture of a camera's empty scene, BGR; None if the recording has none."""
        ...

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        """Return an object that depends on the pictures alone, made at the first call."""
        ...

    def check(self) -> None:
        """Raise an exception if the work is to stop; long computations call this repeatedly."""
        ...


class FrameReader:
    """The reader of all pictures of a sequence. It is thread-safe; close it, or use ``with``."""

    def __init__(self, sequence: Sequence, *, cache_bytes: int = CACHE_BYTES) -> None:
        """Prepare to read; files are opened when first needed.

        Args:
            sequence: The sequence.
            cache_bytes: Largest memory of cached pictures, bytes.
        """
        self._sequence = sequence
        self._cache = _Cache(cache_bytes)
        self._sources = [_Source(view) for view in sequence.views]
        self._walks = [_Walk() for _ in sequence.views]
        largest = max((w * h * 3 for w, h in (c.image_size for c in sequence.cameras)), default=1)
        # reading ahead must not displace pictures that are shown next
        self._ahead = min(AHEAD, cache_bytes // (2 * max(1, len(sequence.views)) * largest))
        self._wanted = threading.Condition()
        self._closed = False
        self._once_lock = threading.Lock()
        self._once_locks: dict[Hashable, threading.Lock] = {}
        self._made: dict[Hashable, Any] = {}
        self._thread: threading.Thread | None = None

    def __enter__(self) -> FrameReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def picture(self, camera: int, step: int) -> Picture | None:
        """Return the picture of one camera at one step, BGR.

        Several callers may get the same array: do not write to it.

        Args:
            camera: The index of the camera in ``sequence.views``.
            step: The step, 0-based.

        Returns:
            None where the camera has no pictures, the file ends before, the frame or
            image cannot be decoded, or the reader is closed.

        Raises:
            IndexError: If there is no such camera.
        """
        if not 0 <= camera < len(self._sources):
            raise IndexError(f"camera must be 0 … {len(self._sources) - 1}, got {camera}")
        source = self._sources[camera]
        if not 0 <= step < self._sequence.frames or not source.view.has_pictures:
            return None
        with self._wanted:
            if self._closed:
                return None
            direction = self._walks[camera].move(step, self._sequence.frames, self._ahead)
            if direction > 0:
                self._start_reading_ahead()
                self._wanted.notify()
        found, picture = self._cache.get(camera, step)
        if found:
            return picture
        with source.lock:
            found, picture = self._cache.get(camera, step)  # read ahead meanwhile
            if found:
                return picture
            if self._closed:
                return None
            if direction < 0:
                self._read_behind(camera, step)
            picture = source.read(step)
            self._cache.put(camera, step, picture)
        return picture

    def iterate(self, camera: int, first: int = 0) -> Iterator[Picture | None]:
        """Yield the pictures of one camera from one step to the last, for the pipeline.

        The decoder is independent of that of :meth:`picture`, and every array is new.
        """
        source = _Source(self._sequence.views[camera])
        try:
            for step in range(first, self._sequence.frames):
                yield source.read(step)
        finally:
            source.close()

    def empty(self, camera: int) -> Picture | None:
        """Return the picture of a camera's empty scene, BGR; None if the recording has none."""
        view = self._sequence.views[camera]
        if not isinstance(view.background, Path):
            return None
        return _of_its_size(view, read_image(view.background))

    def once(self, name: Hashable, make: Callable[[], _Made]) -> _Made:
        """Return an object that depends on the pictures alone, made at the first call.

        Args:
            name: The name of the object; calls with the same name return the same object.
            make: A function that makes the object; other calls with the name wait for it.
        """
        with self._once_lock:
            lock = self._once_locks.setdefault(name, threading.Lock())
        with lock:
            if name not in self._made:
                self._made[name] = make()
            made: _Made = self._made[name]
            return made

    def check(self) -> None:
        """Do nothing; readers that can be stopped raise an exception here."""

    def close(self) -> None:
        """Release files, memory and thread. Closing twice does no harm."""
        with self._wanted:
            self._closed = True
            self._wanted.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        for source in self._sources:
            with source.lock:
                source.close()
        self._cache.clear()

    def _read_behind(self, camera: int, step: int) -> None:
        """Cache some earlier steps, which a jump backwards decodes anyway."""
        source = self._sources[camera]
        for earlier in range(max(0, step - min(BEHIND, self._ahead)), step):
            if not self._cache.has(camera, earlier):
                self._cache.put(camera, earlier, source.read(earlier))

    def _start_reading_ahead(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(
                target=self._read_ahead, name="pictures-ahead", daemon=True
            )
            self._thread.start()

    def _read_ahead(self) -> None:
        """Decode the next pictures of the playback, one at a time, the cameras in turn."""
        camera = 0
        while True:
            with self._wanted:
                while not self._closed and not any(walk.pending for walk in self._walks):
                    self._wanted.wait()
                if self._closed:
                    return
                turns = [(camera + 1 + i) % len(self._walks) for i in range(len(self._walks))]
                camera = next(turn for turn in turns if self._walks[turn].pending)
            source, walk = self._sources[camera], self._walks[camera]
            with source.lock:
                with self._wanted:  # the walk may have gone elsewhere while we waited
                    step = walk.take()
                if step is not None and not self._cache.has(camera, step):
                    self._cache.put(camera, step, source.read(step))


def _of_its_size(view: View, picture: Picture | None) -> Picture | None:
    """Return a picture, or None if it does not have the camera's size."""
    width, height = view.camera.image_size
    return picture if picture is not None and picture.shape[:2] == (height, width) else None


@dataclass(slots=True)
class _Walk:
    """The movement of requests through the steps of one camera, and the steps to read ahead."""

    last: int | None = None
    next_ahead: int = 0
    end_ahead: int = 0

    @property
    def pending(self) -> bool:
        """Whether there are steps to read ahead."""
        return self.next_ahead < self.end_ahead

    def move(self, step: int, frames: int, ahead: int) -> int:
        """Record a request, and return 1 if it continues forwards, −1 backwards, 0 for a jump."""
        distance = 0 if self.last is None else step - self.last
        self.last = step
        if 0 < distance <= NEAR:
            self.next_ahead = max(self.next_ahead, step + 1)
            self.end_ahead = min(step + 1 + ahead, frames)
            return 1
        if distance != 0:
            self.next_ahead = self.end_ahead = 0
        return -1 if -NEAR <= distance < 0 else 0

    def take(self) -> int | None:
        """Return the next step to read ahead; None if there is none."""
        if not self.pending:
            return None
        self.next_ahead += 1
        return self.next_ahead - 1


@dataclass(slots=True, eq=False)
class _Source:
    """The open files of one camera, used by one thread at a time."""

    view: View
    lock: threading.Lock = field(default_factory=threading.Lock)
    _decoder: VideoDecoder | None = None

    def read(self, step: int) -> Picture | None:
        """Decode one step; None if there is no picture of the camera's size."""
        frame = self.view.frame_at(step)
        picture = None
        if frame < 0:
            return None
        if self.view.video is not None:
            picture = self._read_video(frame)
        elif frame < len(self.view.images):
            picture = read_image(self.view.images[frame])
        return _of_its_size(self.view, picture)

    def _read_video(self, frame: int) -> Picture | None:
        if self._decoder is None:
            assert self.view.video is not None
            try:
                self._decoder = VideoDecoder(index_video(self.view.video))
            except (VideoError, OSError):  # gone or spoilt since the sequence was opened
                return None
        return self._decoder.read(frame)

    def close(self) -> None:
        """Release the file."""
        if self._decoder is not None:
            self._decoder.close()


class _Cache:
    """A cache of the pictures that were used last, and of the steps that have none."""

    _OVERHEAD = 200
    """The size of an entry without a picture, bytes."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._used = 0
        self._pictures: OrderedDict[tuple[int, int], Picture | None] = OrderedDict()
        self._lock = threading.Lock()

    def has(self, camera: int, step: int) -> bool:
        """Whether a step is cached; this does not count as use."""
        with self._lock:
            return (camera, step) in self._pictures

    def get(self, camera: int, step: int) -> tuple[bool, Picture | None]:
        """Return whether a step is cached, and its picture."""
        key = (camera, step)
        with self._lock:
            if key not in self._pictures:
                return False, None
            self._pictures.move_to_end(key)
            return True, self._pictures[key]

    def put(self, camera: int, step: int, picture: Picture | None) -> None:
        """Cache a picture, and drop the least recently used ones beyond the limit."""
        key = (camera, step)
        with self._lock:
            self._used += self._size(picture) - (
                self._size(self._pictures.pop(key)) if key in self._pictures else 0
            )
            self._pictures[key] = picture
            while self._used > self._limit and self._pictures:
                self._used -= self._size(self._pictures.popitem(last=False)[1])

    def clear(self) -> None:
        """Drop all pictures."""
        with self._lock:
            self._pictures.clear()
            self._used = 0

    def _size(self, picture: Picture | None) -> int:
        return self._OVERHEAD + (0 if picture is None else picture.nbytes)
