"""Files of others on their way in: uploaded or found on the disk, looked into, written."""

from __future__ import annotations

import logging
import os
import re
import secrets
import shutil
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Any, Literal

import cv2
import numpy as np
from pydantic import ConfigDict, Field

from app.errors import sentence
from app.messages import Described
from app.state.snapshot import Task
from app.state.workbench import Workbench
from tracker.files.folders import settings_folder
from tracker.io.importing.options import CommonImportOptions, ImportOptions
from tracker.io.read.pieces import (
    METRES,
    DetectionPiece,
    FormatError,
    ImagesPiece,
    Piece,
    VideoPiece,
)
from tracker.parameters import MethodKey
from tracker.runs.pipeline import Cancelled
from tracker.sequences.finding import Remedy
from tracker.sequences.pictures.video import VideoDecoder, VideoError, index_video, read_image
from tracker.sequences.reader import FILE, given_folder

if TYPE_CHECKING:
    from app.state.looking import Looked
    from tracker.io.conventions.questions import Question
    from tracker.io.importing.arriving import Footprint
    from tracker.io.importing.gathering import ParsedFiles
    from tracker.io.importing.settling import ImportPlan, PlannedView

MOST_BYTES = 64 << 30
"""Of all files of a recording together."""

MOST_FILES = 50_000
MOST_PARTS = 10
"""Folders within each other, the file's own name counted."""

LONGEST_PART = 200
SPARED_BYTES = 256 << 20
"""So much is left free on the disk."""

_DEVICES = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)


class UploadError(ValueError):
    """A file cannot be taken; the message names it, expected, found, what to do."""


@dataclass(frozen=True, slots=True)
class Announced:
    """A file that is to come."""

    path: str
    """From the folder that was dropped, with slashes; or its name alone."""
    bytes: int


def safe_path(path: str) -> PurePosixPath:
    """A file's path inside the folder of its upload.

    Raises:
        UploadError: If it leads elsewhere, or is none that every file system takes.
    """
    shown = repr(path[:100])
    parts = path.split("/")
    if "\\" in path or ":" in path:
        raise UploadError(
            f"{shown}: expected a name without backslash and colon; rename the file and try again"
        )
    if any(ord(letter) < 32 or ord(letter) == 127 for letter in path):
        raise UploadError(f"{shown}: expected a name without control characters; rename the file")
    if path.startswith("/") or any(part in ("", ".", "..") for part in parts):
        raise UploadError(
            f"{shown}: expected a path inside the dropped folder, found one that leads elsewhere; "
            "drop the folder itself"
        )
    if len(parts) > MOST_PARTS:
        raise UploadError(
            f"{shown}: lies in more than {MOST_PARTS - 1} folders within each other; drop the "
            "folder of the recording itself"
        )
    for part in parts:
        if len(part.encode()) > LONGEST_PART:
            raise UploadError(
                f"{shown}: has a name of more than {LONGEST_PART} bytes; rename the file"
            )
        if _DEVICES.fullmatch(part) or part.endswith((" ", ".")):
            raise UploadError(f"{shown}: is a name that not every file system takes; rename it")
    return PurePosixPath(*parts)


class Upload:
    """A folder that is filled piece by piece. One thread at a time."""

    def __init__(self, folder: Path) -> None:
        """Begin.

        Args:
            folder: New; the files go below it.
        """
        self.folder = folder
        self._files: list[Announced] = []
        self._paths: list[Path] = []
        self._received: list[int] = []

    @property
    def size(self) -> int:
        """All files that were announced."""
        return sum(file.bytes for file in self._files)

    @property
    def received(self) -> int:
        """Bytes that are here."""
        return sum(self._received)

    @property
    def complete(self) -> bool:
        """Whether all announced files are here."""
        return self.received == self.size

    @property
    def files(self) -> int:
        """How many were announced."""
        return len(self._files)

    def names(self, most: int) -> list[str]:
        """Of the announced files, the first so many."""
        return [file.path for file in self._files[:most]]

    def announce(self, files: Sequence[Announced]) -> int:
        """More files are to come; the number of the first of them.

        Raises:
            UploadError: If one cannot be taken, or all together have no room; none is then.
        """
        first, known = len(self._files), {path for path in self._paths}
        paths: list[Path] = []
        for file in files:
            path = self.folder / safe_path(file.path)
            if path in known:
                raise UploadError(f"{file.path!r}: is among the files already; rename one")
            known.add(path)
            paths.append(path)
        if len(known) > MOST_FILES:
            raise UploadError(
                f"expected at most {MOST_FILES:,} files, found {len(known):,}: open the folder "
                "by its path"
            )
        self._check_room(sum(file.bytes for file in files))
        made: list[Path] = []
        for path, file in zip(paths, files, strict=True):
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                path.touch(exist_ok=False)
                made.append(path)
            except OSError as error:  # a file where another one needs a folder
                for other in made:
                    other.unlink(missing_ok=True)
                raise UploadError(f"{file.path!r}: cannot be written ({error.strerror})") from None
        self._files += files
        self._paths += paths
        self._received += [0] * len(files)
        return first

    def _check_room(self, more: int) -> None:
        if self.size + more > MOST_BYTES:
            raise UploadError(
                f"expected at most {MOST_BYTES >> 30} GB, found {(self.size + more) / 2**30:.1f}: "
                "open the folder by its path"
            )
        left = self.size - self.received
        free = shutil.disk_usage(self.folder.parent).free - SPARED_BYTES
        if left + more > free:
            raise UploadError(
                f"{self.folder.parent} has room for {max(0, free) / 2**30:.1f} GB, the files need "
                f"{(left + more) / 2**30:.1f}; make room, or open a folder by its path"
            )

    def receive(self, number: int, offset: int, data: bytes) -> None:
        """The next piece of a file.

        Raises:
            UploadError: If there is no such file, or the piece is not the next one.
        """
        if not 0 <= number < len(self._files):
            raise UploadError(f"expected a file that was announced, found number {number}")
        file, here = self._files[number], self._received[number]
        if offset != here:
            raise UploadError(
                f"{file.path}: expected the piece from byte {here} on, found one from {offset}"
            )
        if offset + len(data) > file.bytes:
            raise UploadError(
                f"{file.path}: expected {file.bytes:,} bytes as announced, found more; it was "
                "changed meanwhile: drop it again"
            )
        # by its place: of a piece that the disk had no room for, a part may be there already
        with self._paths[number].open("r+b") as stream:
            stream.seek(offset)
            stream.write(data)
        self._received[number] += len(data)


class ImportWish(CommonImportOptions, Described):
    """What somebody knows better than the files; null and empty: as it was found out."""

    model_config = ConfigDict(json_schema_serialization_defaults_required=True)

    name: str = Field(default="", max_length=120)
    files: tuple[tuple[str, str], ...] = Field(default=(), max_length=400)
    """A camera, and the label of a file that is its."""
    methods: Mapping[MethodKey, str | None] = {}
    """What it is to be tracked with; null, or not there: what fits."""
    copy_files: bool = False
    """Whether what lies elsewhere on the disk is copied, not linked."""


_OWN = set(ImportWish.model_fields) - set(CommonImportOptions.model_fields)


def looks_alike(one: ImportWish, other: ImportWish) -> bool:
    """Whether the files say the same under both wishes."""
    later = {"name", "copy_files", "methods", "entrances"}
    return one.model_dump(exclude=later) == other.model_dump(exclude=later)


def options_of(wish: ImportWish, taken: Sequence[ParsedFiles]) -> ImportOptions:
    """The same as the import takes it.

    Raises:
        FormatError: If it names a file that is not there.
    """
    return ImportOptions(**wish.model_dump(exclude=_OWN), cameras=_files(wish, taken))


def _files(wish: ImportWish, taken: Sequence[ParsedFiles]) -> tuple[tuple[str, Path], ...]:
    known = places(taken)
    for _, label in wish.files:
        if label not in known:
            raise FormatError(f"{label}: is neither pictures nor boxes; choose another file")
    return tuple((camera, known[label]) for camera, label in wish.files)


def places(taken: Sequence[ParsedFiles]) -> dict[str, Path]:
    """Videos, folders of pictures and files of boxes that a camera may be given, by label."""
    found: dict[str, Path] = {}
    for one in taken:
        own = [place for piece in one.pieces if (place := _place(piece)) is not None]
        if len(own) == 1:
            found[one.label] = own[0]
        elif len(set(own)) == len(own):  # a file a camera, named after its folder's first
            found |= {place.name: place for place in own}
    return found


def _place(piece: Piece) -> Path | None:
    match piece:
        case VideoPiece():
            return piece.path
        case ImagesPiece():
            return piece.folder
        case DetectionPiece():
            return piece.source
    return None


def mended(wish: ImportWish, remedies: Sequence[Remedy]) -> dict[str, Any]:
    """What remedies change of a wish; nothing where the page cannot mend it."""
    own = {called: name for name, called in wish.names.items()}  # checks call cameras as shown
    changes: dict[str, Any] = {}
    room: dict[str, Any] = {}
    for remedy in remedies:
        flag, value = remedy.flag.removeprefix("--"), remedy.value
        if flag in ("pose", "axes", "up"):
            changes[flag] = value
        elif flag == "unit":
            changes[flag] = value if value in METRES else float(value)
        elif flag == "boxes":
            layout, _, normalised = value.partition("-")
            changes |= {"boxes": layout, "normalised": True if normalised else None}
        elif flag == "euler":
            changes["turns"] = value
        elif flag == "accept-best":
            changes["accept_best"] = True
        elif flag == "first-index":
            changes["first_index"] = int(value)
        elif flag == "as-named":
            changes |= {"as_named": True, "swap": ()}
        elif flag == "swap":
            first, _, second = value.partition("=")
            changes["swap"] = (
                *changes.get("swap", wish.swap),
                (own.get(first, first), own.get(second, second)),
            )
        elif flag == "target.half_extents":
            changes["half_extents"] = _numbers(value)
        elif flag in ("room.min", "room.max"):
            room[flag] = _numbers(value)
        elif flag == "camera.time_offset":
            offsets = changes.get("offsets", dict(wish.offsets))
            camera = own.get(remedy.camera, remedy.camera)
            total = wish.offsets.get(camera, 0.0) + float(value)
            changes["offsets"] = {**offsets, camera: round(total, 4)}
    if len(room) == 2:
        changes["room"] = (room["room.min"], room["room.max"])
    return changes


def _numbers(text: str) -> tuple[float, ...]:
    return tuple(float(part) for part in text.strip("[]").split(","))


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
        show(f"import {key}", Task(of=key, state=self._known.phase))
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
            self._publish(wish=wish)
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
            self._publish(phase="uploading", busy=False)

    def _publish(self, **changes: object) -> None:
        with self._lock:
            version = self._known.version + 1
            self._known = replace(self._known, version=version, **changes)  # type: ignore[arg-type]
            # what is known of it is more than a task tells: its version says when to ask
            self._show(
                f"import {self.key}", Task(of=self.key, state=self._known.phase, done=version)
            )

    def _look_again(self) -> None:
        """Find everything out in the background; what was under way is given up."""
        self._stop.set()
        stop = self._stop = threading.Event()
        phase: Phase = "settled" if self._gathered and self._known.settled else "reading"
        self._publish(phase=phase, busy=True, error="", undecided="", question=None, waiting="")
        threading.Thread(target=self._look, args=(stop,), name="importing", daemon=True).start()

    def _look(self, stop: threading.Event) -> None:
        def tell(**changes: object) -> None:
            with self._lock:
                if stop.is_set():
                    raise Cancelled
                self._publish(**changes)

        # the readers of all formats: a server starts without them
        from app.state.looking import look_into
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
                    self._publish(phase="failed", busy=False, error=sentence(error))

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
            self._publish(phase="writing", busy=False, error="", copied=0, copying_since=began)
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
                self._publish(phase="settled", error=f"it cannot be written: {sentence(error)}")
                if self._given_up:
                    shutil.rmtree(self.folder, ignore_errors=True)
            return
        if not wish.copy_files or self.uploaded or not links_in(place):
            self._publish(phase="written", folder=place, told=tuple(told))
            then(place)
            return
        self._publish(phase="copying", folder=place, told=tuple(told))
        then(place)
        try:
            copy_links(place, self._copied)
        except Cancelled:
            told.append("the copying was stopped: what is not copied is linked")
        except OSError as error:
            told.append(f"not all files are copied, the others are linked: {sentence(error)}")
        self._publish(phase="written", told=tuple(told))

    def _copied(self, more: int) -> None:
        if self._given_up:
            raise Cancelled
        self._publish(copied=self._known.copied + more)

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


MOST_DRAFTS = 4
"""Imports that are begun and neither written nor given up; the oldest makes room for another."""

FORGOTTEN_SECONDS = 86400.0
"""What an earlier start left half uploaded is removed after this time."""


class Desk:
    """Thread-safe owner of all drafts."""

    def __init__(self, workbench: Workbench, data: Path | None = None) -> None:
        """Nothing is written yet.

        Args:
            workbench: Shows how far imports are.
            data: Where recordings are; the person's own place where none is given or it can only
                be read.
        """
        self._workbench = workbench
        own = settings_folder() / "recordings"
        self.home = data.absolute() if data is not None and os.access(data, os.W_OK) else own
        self._data = data.absolute() if data is not None else self.home
        self._lock = threading.Lock()
        self._drafts: dict[str, Draft] = {}

    def begin(self, files: Sequence[Announced]) -> Draft:
        """An import of files that a page is going to send.

        Raises:
            UploadError: If one of them cannot be taken.
        """
        first = files[0].path.split("/")[0] if files else "recording"
        name = first if any("/" in file.path for file in files) else "recording"
        draft = self._new(name, None)
        try:
            draft.upload.announce(files)
        except UploadError:
            self.discard(draft.key)
            raise
        return draft

    def begin_from(self, path: str) -> Draft | Path:
        """An import of files on this machine; where they are a recording already, its folder.

        Args:
            path: A folder or file, in full or from the data folder on. Whoever may use the
                workbench may name any: the manual's page on security says why.

        Raises:
            UploadError: If it is not there.
        """
        try:
            given = given_folder(path)
            place = (self._data / given).resolve()
        except (ValueError, RuntimeError) as error:  # a null byte, no such person, a circle
            raise UploadError(sentence(error)) from None
        if place.name == FILE:
            place = place.parent
        if (place / FILE).is_file():
            return place
        if not place.exists():
            where = "" if given.is_absolute() else f" in {self._data}"
            raise UploadError(f"{path}: there is no such file or folder{where}")
        if not (place.is_dir() or place.is_file()):
            raise UploadError(f"{path}: expected a folder or a file, found neither; name one")
        return self._new(place.stem if place.is_file() else place.name, place)

    def folders(self) -> list[str]:
        """Folders below the data folder that are no recordings yet."""
        if not self._data.is_dir():
            return []
        return sorted(
            path.name
            for path in self._data.iterdir()
            # of the module, for a method fails at a folder that may not be read
            if path.is_dir() and not path.name.startswith(".") and not os.path.isfile(path / FILE)
        )

    def free(self) -> int:
        """Bytes on the disk of the recordings."""
        place = next(one for one in (self.home, *self.home.parents) if one.exists())
        return shutil.disk_usage(place).free

    def _new(self, name: str, source: Path | None) -> Draft:
        try:
            self.home.mkdir(parents=True, exist_ok=True)
            self._tidy()
            draft = Draft(
                secrets.token_hex(8),
                self.home,
                self._free_name(name),
                self._workbench.show_task,
                source,
            )
        except OSError as error:
            raise UploadError(
                f"{self.home}: cannot be written ({error.strerror}); start the workbench with "
                "--data and a folder that can"
            ) from None
        with self._lock:
            self._drafts[draft.key] = draft
            begun = ("writing", "copying")
            waiting = [key for key, d in self._drafts.items() if d.known.phase not in begun]
        for key in waiting[:-MOST_DRAFTS]:
            self.discard(key)
        return draft

    def _free_name(self, name: str) -> str:
        plain = folder_name(name)
        found, number = plain, 1
        while (self.home / found).exists():
            number += 1
            found = f"{plain}-{number}"
        return found

    def _tidy(self) -> None:
        """Without what an earlier start left here."""
        for path in self.home.glob(".import-*"):
            own = path.name.removeprefix(".import-") in self._drafts
            if not own and time.time() - path.stat().st_mtime > FORGOTTEN_SECONDS:
                shutil.rmtree(path, ignore_errors=True)

    def draft(self, key: str) -> Draft | None:
        """One that is under way."""
        return self._drafts.get(key)

    def discard(self, key: str) -> None:
        """Give one up; what was uploaded for it is removed."""
        with self._lock:
            draft = self._drafts.pop(key, None)
        if draft is not None:
            draft.discard()

    def close(self) -> None:
        """Give up all."""
        for key in list(self._drafts):
            self.discard(key)
