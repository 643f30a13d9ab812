"""What pages and server tell each other of opening and importing."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from app.models.base import GivenPath, Model, Vector
from app.state.importing.draft import Phase
from app.state.importing.wish import ImportWish
from tracker.io.checks import Status
from tracker.io.conventions.questions import Part
from tracker.sequences.sequence import PRESETS


class AnnouncedFile(Model):
    """A file that is to come."""

    path: str = Field(max_length=4096)
    """From the folder that was dropped, with slashes; or its name alone."""
    bytes: int = Field(ge=0)


class AnnouncedFiles(Model):
    """Files that are to come."""

    files: list[AnnouncedFile] = Field(max_length=50_000)


class PathRequest(Model):
    """A folder or file on the machine that runs the workbench."""

    path: GivenPath


class WriteRequest(Model):
    """Write the recording."""

    open: bool = True
    """Open it when it is written, and so track."""


class ImportedFile(Model):
    """A file, or a series of numbered ones, and what it was taken for."""

    label: str
    format: str
    """What it was taken for; empty where it is read with another file, or not at all."""
    read_with: str
    """The label of the file that it is read with; empty for the others."""
    why: str
    """Why it is not used, as far as it is known of the file alone; else empty."""
    count: int
    """The number of files."""
    used: int
    """The number of them that the recording is made of."""


class ImportedOffset(Model):
    """How late a camera is against the others, as it is now."""

    steps: float
    seconds: float
    sharpness: float
    sure: bool
    offsets: list[float]
    """Steps that were tried."""
    agreement: list[float | None]
    """Of each; null where too little is left to compare."""


class ImportedCamera(Model):
    """A camera with what belongs to it."""

    key: str
    """Its name in the calibration."""
    name: str
    video: str
    """Name of the file, or of the folder of pictures; empty where there is none."""
    frames: int
    fps: float
    width: int
    height: int
    calibration: str
    """The file of its calibration; what it was recognised as, where it is made of several."""
    calibration_format: str
    calibration_of: str
    """The camera whose calibration it has by its file: its own, unless they are exchanged."""
    detections: str
    boxes_format: str
    boxes_per_step: float
    seconds_late: float
    """As it is wished."""
    offset: ImportedOffset | None
    """As it was found, beyond what is wished."""


class ImportedCheck(Model):
    """A check, and what mends it."""

    name: str
    status: Status
    sentence: str
    remedy: str
    """The field of the sheet and what it should be; empty where there is none."""
    mend: ImportWish | None
    """The wish that mends it; null where nothing here does."""
    cameras: list[str]
    """The keys of the cameras that do not fit the others, where it is about them."""


class ImportedPair(Model):
    """How well the boxes of two cameras meet."""

    first: str
    second: str
    share: float
    pixels: float | None
    odd: bool


class ImportedPlan(Model):
    """The room from above, metres."""

    x: float
    y: float
    cell: float
    width: int
    height: int
    seen: list[int]
    """How many cameras see the floor, by cell, rows along y."""
    entrances: list[tuple[float, float, float, float]]
    """Of those that are wished, else of those that are suggested: x, y and how wide they are."""
    cameras: list[tuple[float, float, float, float]]
    """x, y, direction and half the angle across, radians."""
    feet: list[tuple[float, float]]


class ImportQuestion(Model):
    """What is asked where the files leave open how they are meant."""

    code: Part
    """The first part of the interpretation that differs."""
    interpretations: tuple[str, str]
    """In words, the likelier one first."""
    difference: str
    chosen: tuple[str, str]
    """The fields of the sheet that each states, and how."""
    wishes: tuple[ImportWish, ImportWish]
    """What decides for each here."""


class ImportInfo(Model):
    """An import on its way."""

    key: str
    version: int
    phase: Phase
    busy: bool
    under_way: str
    """What is being looked into."""
    error: str
    undecided: str
    """Why nothing can be written before somebody decides how the files are meant; else empty."""
    question: ImportQuestion | None
    wish: ImportWish
    received: int
    """Bytes."""
    bytes: int
    files: list[ImportedFile]
    """The first of them: those that are used, then those that are not for a reason of their own."""
    files_there: int
    """The number of all files."""
    files_used: int
    """The number of those that the recording is made of."""
    coming: list[str]
    """Files that were announced and are not yet understood, the first of them."""
    offered: list[str]
    """Labels of pictures and boxes that a camera may be given."""
    uploaded: bool
    """Whether the files were sent by a page."""
    home: str
    place: str
    """The name of its folder there, which has no signs that not every file system takes."""
    free: int
    """Bytes on the disk of the recordings."""
    fps: float
    frames: int
    unit: str
    up: str
    pose: str
    axes: str
    boxes: str
    """How the four numbers of a box are meant; empty where files differ or have none."""
    first_index: str
    """The number of the first frame in files of boxes; empty where there are none."""
    turns: str
    """How rotations given by three angles were taken; empty where there are none."""
    open_turns: list[tuple[str, str]]
    """How they may be composed: what is wished, and words; what the names leave open."""
    room: tuple[Vector, Vector] | None
    suggested: tuple[Vector, Vector] | None
    half_extents: Vector | None
    suggested_half_extents: Vector | None
    entrances: list[tuple[Vector, Vector]]
    """Suggested where tracks of a first run begin and end: position, standard deviations."""
    fitting: dict[str, str]
    """What it is tracked with unless somebody wishes otherwise, by what chooses a method."""
    unfit: dict[str, dict[str, str]]
    """Methods that cannot work on it, each with the reason."""
    copied: int
    """Bytes, of the files that become its own."""
    megabytes_per_second: float
    truth: int
    """People in the truth; 0 where there is none."""
    has_boxes: bool
    """Whether every camera has boxes."""
    found: list[tuple[str, str]]
    told: list[str]
    cameras: list[ImportedCamera]
    checks: list[ImportedCheck]
    pairs: list[ImportedPair]
    plan: ImportedPlan | None
    folder: str
    """Where it was written."""
    sizes: dict[str, Vector] = PRESETS
    """Half width, depth and height of common targets in metres, by their words."""


class Begun(Model):
    """An import that was begun, or a recording that needs none."""

    draft: ImportInfo | None
    first: int = 0
    """Number of the first of the files that were announced."""
    recording: str = ""
    """The folder of a recording that is one already."""


class RecordingCard(Model):
    """A recording that can be opened."""

    name: str
    opens: str
    """What opens it."""
    kind: Literal["recent", "folder", "rendered"]
    description: str
    cameras: int
    frames: int
    fps: float
    """0 where it is not known before it is opened."""
    opened: float
    """Seconds since 1970; 0 where it never was."""
    picture: str
    """Address of its picture; empty where there is none yet."""
    open: bool
    """Whether it is what is open now."""


class Recordings(Model):
    """What can be opened at once, and what can be imported from the disk."""

    recordings: list[RecordingCard]
    folders: list[str]
    """Below the data folder, that are no recordings yet."""
    data: str
    """Where recordings go."""
    free: int
    """Bytes on that disk."""
    most: int
    """Bytes that an upload may have."""
