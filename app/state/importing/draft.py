"""One import on its way: files that come, what they are taken for, what was found out of them."""

from __future__ import annotations

import logging
import re
import shutil
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import cv2
import numpy as np

from app.errors import sentence
from app.state.importing.uploads import Upload
from app.state.importing.wish import ImportWish, looks_alike, options_of
from app.state.snapshot import Task
from tracker.io.read.pieces import FormatError, ImagesPiece, VideoPiece
from tracker.runs.pipeline import Cancelled
from tracker.sequences.pictures.video import VideoDecoder, VideoError, index_video, read_image
from tracker.sequences.reader import FILE

if TYPE_CHECKING:
    from app.state.importing.looking import Looked
    from tracker.io.conventions.questions import Question
    from tracker.io.importing.arriving import Footprint
    from tracker.io.importing.gathering import ParsedFiles
    from tracker.io.importing.settling import ImportPlan, PlannedView

logger = logging.getLogger("app")

Phase = Literal["uploading", "reading", "settled", "failed", "writing", "copying", "written"]
"""While it is copying, it is a recording that can be opened already."""

_BEGUN: tuple[Phase, ...] = ("writing", "copying", "written")

PICTURE_WIDTH = 256
FILES = "files"
"""Where uploaded files lie in the folder of their recording."""


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """What is known of a draft at one moment."""

    phase: Phase
    wish: ImportWish
    version: int = 0
    """Grows with every change."""
    taken: tuple[ParsedFiles, ...] = ()
    settled: ImportPlan | None = None
    """As it was wished last and could be; also while another wish is being looked into."""
    looked: Looked | None = None
    busy: bool = False
    """Whether something is being looked into."""
    waiting: str = ""
    """What is waited for before anything is read: a file that is still being copied there."""
    error: str = ""
    undecided: str = ""
    """Why nothing can be written before somebody decides how the files are meant."""
    question: Question | None = None
    """What is asked where the files leave open how they are meant."""
    folder: Path | None = None
    """Where it was written."""
    told: tuple[str, ...] = field(default_factory=tuple)
    copied: int = 0
    """Bytes that were copied, of :attr:`Draft.size`."""
    copying_since: float = 0.0
    """Seconds of ``time.monotonic``, when that began."""


class Draft:
    """See the module's words; any thread may ask."""

    def __init__(
        self,
        key: str,
        home: Path,
        name: str,
        show: Callable[[str, Task | None], None],
        source: Path | None = None,
    ) -> None:
        """Begin.

        Args:
            key: Of the draft.
            home: Folder of the recordings that it may become one of.
            name: What it is called until somebody says otherwise.
            show: Tells of a task, by its kind; None of none any more.
            source: Files that are there already; None: they are uploaded.
        """
        self.key, self._show = key, show
        self.home = home
        self.folder = home / f".import-{key}"
        self.folder.mkdir(parents=True)
        self.uploaded = source is None
        self.upload = Upload(self.folder / FILES)
        if self.uploaded:
            self.upload.folder.mkdir()
        self._source = source
        self._lock = threading.RLock()
        self._known = Known("uploading" if source is None else "reading", ImportWish(name=name))
        self._gathered = False
        self._read: Footprint = {}
        self._stop = threading.Event()
        self._given_up = False
        self._pictures: dict[Path, bytes | None] = {}
        show(f"import {key}", Task(key, self._known.phase))
        if source is not None:
            self._look_again()

    @property
    def known(self) -> Known:
        """What is known now."""
        return self._known

    @property
    def sources(self) -> list[Path]:
        """The files that it is made of: those that were there, and those that were sent."""
        sent = [self.upload.folder] if self.upload.folder.is_dir() else []
        return sent if self._source is None else [self._source, *sent]

    @property
    def size(self) -> int:
        """Of all videos, pictures and boxes that it is made of."""
        if self.uploaded:
            return self.upload.size
        # as they were when they were read: the page asks again and again
        return sum(
            self._read.get(path, (0, 0))[0]
            for one in self._known.taken
            if one.pieces
            for path in one.files
        )

    def wish(self, wish: ImportWish) -> None:
        """Have it otherwise; what follows is found out anew, where it is more than the name."""
        with self._lock:
            if self._known.phase in _BEGUN:
                return
            before = self._known.wish
            self._tell(wish=wish)
            if not looks_alike(before, wish) and self._gathered:
                self._look_again()

    def check_open(self) -> None:
        """Nothing can come to it once it is being written.

        Raises:
            FormatError: If it is, or was.
        """
        if self._known.phase in _BEGUN:
            raise FormatError("this recording is being written already; import the rest by itself")

    def arrived(self) -> None:
        """All files are there.

        Raises:
            FormatError: If it is being written.
        """
        with self._lock:
            self.check_open()
            self._gathered = False
            self._look_again()

    def awaits(self) -> None:
        """More files are to come.

        Raises:
            FormatError: If it is being written.
        """
        with self._lock:
            self.check_open()
            self._stop.set()
            # else a wish would have it settled while files are on their way
            self._gathered = False
            self._tell(phase="uploading", busy=False)

    def _tell(self, **changes: object) -> None:
        with self._lock:
            version = self._known.version + 1
            self._known = replace(self._known, version=version, **changes)  # type: ignore[arg-type]
            # what is known of it is more than a task tells: its version says when to ask
            self._show(f"import {self.key}", Task(self.key, self._known.phase, version))

    def _look_again(self) -> None:
        """Find everything out in the background; what was under way is given up."""
        self._stop.set()
        stop = self._stop = threading.Event()
        phase: Phase = "settled" if self._gathered and self._known.settled else "reading"
        self._tell(phase=phase, busy=True, error="", undecided="", question=None, waiting="")
        threading.Thread(target=self._look, args=(stop,), name="importing", daemon=True).start()

    def _look(self, stop: threading.Event) -> None:
        def tell(**changes: object) -> None:
            with self._lock:
                if stop.is_set():
                    raise Cancelled
                self._tell(**changes)

        # the readers of all formats: a server starts without them
        from app.state.importing.looking import look_into
        from tracker.io.conventions.questions import Undecided
        from tracker.io.importing.arriving import gather_whole
        from tracker.io.importing.settling import settle

        def sleep(seconds: float) -> None:
            if stop.wait(seconds):
                raise Cancelled

        try:
            with self._lock:
                wish, taken, gathered = self._known.wish, self._known.taken, self._gathered
            if not gathered:
                found, read = gather_whole(self.sources, lambda t: tell(waiting=t), sleep)
                taken = tuple(found)
                with self._lock:
                    tell(taken=taken, waiting="")
                    self._gathered, self._read = True, read
            options = options_of(wish, taken)
            settled = settle(taken, options.model_copy(update={"accept_best": True}))
            open_ = None if options.accept_best else settled.open
            question = open_.question if isinstance(open_, Undecided) else None
            undecided = "" if open_ is None else sentence(open_)
            tell(settled=settled, phase="settled", error="", undecided=undecided, question=question)
            for looked in look_into(settled, wish.name, stop.is_set):
                tell(looked=looked)
            tell(busy=False)
        except Cancelled:
            return
        except Exception as error:
            if not isinstance(error, ValueError | OSError):
                logger.exception("looking into an import failed")
            with self._lock:
                if not stop.is_set():
                    self._tell(phase="failed", busy=False, error=sentence(error))

    def picture(self, camera: str) -> bytes | None:
        """The middle picture of a camera, by its name in the calibration, as JPEG."""
        settled = self._known.settled
        view = next(
            (v for v in settled.views if v.matched.raw.name == camera) if settled else iter(()),
            None,
        )
        if view is None:
            return None
        video, images = view.matched.video, view.matched.images
        # a camera may be given other pictures, by a wish or by further files
        key = video.path if video else images.files[0] if images else None
        if key is None:
            return None
        if key not in self._pictures:
            self._pictures[key] = _middle(view)
        return self._pictures[key]

    def write(self, then: Callable[[Path], object]) -> None:
        """Write it as a recording, in the background.

        Args:
            then: Called with the folder.

        Raises:
            FormatError: If it cannot become one yet, or its name is taken.
        """
        with self._lock:
            known = self._known
            if known.undecided:
                raise FormatError(known.undecided)
            if known.phase != "settled":
                raise FormatError(known.error or "the files are not understood yet; wait a moment")
            place = self.home / folder_name(known.wish.name)
            if place.exists():
                raise FormatError(f"there is a recording {place.name} already; choose another name")
            self._check_unchanged()
            self._stop.set()
            began = time.monotonic()
            self._tell(phase="writing", busy=False, error="", copied=0, copying_since=began)
        arguments = (known.taken, known.wish, place, then)
        threading.Thread(target=self._write, args=arguments, name="import", daemon=True).start()

    def _check_unchanged(self) -> None:
        """What was looked at is what is written.

        Raises:
            FormatError: If files came or were written to since; they are looked at again.
        """
        from tracker.io.importing.arriving import changed_since

        changed = changed_since(self.sources, self._read)
        if changed:
            self._gathered = False
            self._look_again()
            raise FormatError(
                f"{changed[0].name} came or was changed after the files were read; they are read "
                "again: import when they are"
            )

    def _write(
        self,
        taken: tuple[ParsedFiles, ...],
        wish: ImportWish,
        place: Path,
        then: Callable[[Path], object],
    ) -> None:
        from tracker.io.importing.settling import settle
        from tracker.io.importing.writing import copy_links, links_in, write

        try:
            # what was wished last may not have been looked into yet
            settled = settle(taken, options_of(wish, taken))
            # linked first, so that it can be opened at once; what cannot be is copied here
            told = write(settled, self.folder, wish.name or place.name, copied=self._copied)
            self.folder.replace(place)
        except Exception as error:
            if not isinstance(error, ValueError | OSError | Cancelled):
                logger.exception("writing an import failed")
            with self._lock:
                # else it could not be tried again under another name
                (self.folder / FILE).unlink(missing_ok=True)
                self._tell(phase="settled", error=f"it cannot be written: {sentence(error)}")
                if self._given_up:
                    shutil.rmtree(self.folder, ignore_errors=True)
            return
        if not wish.copy_files or self.uploaded or not links_in(place):
            self._tell(phase="written", folder=place, told=tuple(told))
            then(place)
            return
        self._tell(phase="copying", folder=place, told=tuple(told))
        then(place)
        try:
            copy_links(place, self._copied)
        except Cancelled:
            told.append("the copying was stopped: what is not copied is linked")
        except OSError as error:
            told.append(f"not all files are copied, the others are linked: {sentence(error)}")
        self._tell(phase="written", told=tuple(told))

    def _copied(self, more: int) -> None:
        if self._given_up:
            raise Cancelled
        self._tell(copied=self._known.copied + more)

    def discard(self) -> None:
        """Give it up; what was uploaded for it is removed."""
        with self._lock:
            self._stop.set()
            self._given_up = True
            self._show(f"import {self.key}", None)
            if self._known.phase not in _BEGUN:
                shutil.rmtree(self.folder, ignore_errors=True)


def folder_name(name: str) -> str:
    """A name as a folder's: letters, digits, blanks, dashes and dots."""
    return re.sub(r"[^\w\- .]+", "-", name).strip(" .-")[:80] or "recording"


def _middle(view: PlannedView) -> bytes | None:
    pictures: VideoPiece | ImagesPiece | None = view.matched.video or view.matched.images
    picture = None
    if isinstance(pictures, VideoPiece):
        try:
            with VideoDecoder(index_video(pictures.path)) as decoder:
                picture = decoder.read(pictures.frames // 2)
        except (VideoError, OSError):
            return None
    elif pictures is not None:
        picture = read_image(pictures.files[len(pictures.files) // 2])
    return None if picture is None else small_jpeg(picture)


def small_jpeg(picture: np.ndarray) -> bytes | None:
    """A picture as wide as a card, as JPEG."""
    height = max(1, round(picture.shape[0] * PICTURE_WIDTH / picture.shape[1]))
    if picture.shape[1] > PICTURE_WIDTH:
        picture = cv2.resize(picture, (PICTURE_WIDTH, height), interpolation=cv2.INTER_AREA)
    done, data = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 82])
    return bytes(data) if done else None
