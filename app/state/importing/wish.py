"""What somebody wishes of an import: the name, and what is known better than the files say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from tracker.io.importing.options import Corner, ImportOptions
from tracker.io.read.pieces import (
    METRES,
    Axes,
    DetectionPiece,
    Direction,
    FormatError,
    ImagesPiece,
    Layout,
    Piece,
    Unit,
    Up,
    VideoPiece,
)
from tracker.sequences.finding import Remedy

if TYPE_CHECKING:
    from tracker.io.importing.gathering import ParsedFiles


@dataclass(frozen=True, slots=True)
class Wish:
    """None and empty: as it was found out."""

    name: str = ""
    unit: Unit | None = None
    up: Up | None = None
    pose: Direction | None = None
    axes: Axes | None = None
    boxes: Layout | None = None
    normalised: bool | None = None
    accept_best: bool = False
    first_index: int | None = None
    turns: str | None = None
    """How rotations given by three angles are composed."""
    fps: float | None = None
    swap: tuple[tuple[str, str], ...] = ()
    left_out: tuple[str, ...] = ()
    names: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    offsets: Mapping[str, float] = field(default_factory=lambda: MappingProxyType({}))
    """Seconds, by camera."""
    files: tuple[tuple[str, str], ...] = ()
    """A camera, and the label of a file that is its."""
    room: tuple[Corner, Corner] | None = None
    half_extents: Corner | None = None
    entrances: tuple[tuple[Corner, Corner], ...] = ()
    """Of each the position and the standard deviations, metres."""
    methods: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    """What it is to be tracked with, by the parameter that chooses a method."""
    copy: bool = False


WORDS = tuple(one.name for one in fields(Wish))


def looks_alike(one: Wish, other: Wish) -> bool:
    """Whether the files say the same under both wishes."""
    later = {"name": "", "copy": False, "methods": {}, "entrances": ()}
    return replace(one, **later) == replace(other, **later)  # type: ignore[arg-type]


def options_of(wish: Wish, taken: Sequence[ParsedFiles]) -> ImportOptions:
    """The same as the import takes it.

    Raises:
        FormatError: If it names a file that is not there.
    """
    first: Any = wish.first_index
    return ImportOptions(
        unit=wish.unit,
        up=wish.up,
        pose=wish.pose,
        axes=wish.axes,
        boxes=wish.boxes,
        normalised=wish.normalised,
        accept_best=wish.accept_best,
        first_index=first,
        turns=wish.turns,
        fps=wish.fps,
        cameras=_files(wish, taken),
        swap=wish.swap,
        left_out=frozenset(wish.left_out),
        names=wish.names,
        offsets=wish.offsets,
        room=wish.room,
        half_extents=wish.half_extents,
        entrances=wish.entrances,
    )


def _files(wish: Wish, taken: Sequence[ParsedFiles]) -> tuple[tuple[str, Path], ...]:
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


def mended(wish: Wish, remedies: Sequence[Remedy]) -> dict[str, Any]:
    """What remedies change of a wish; nothing where the page cannot mend it."""
    own = {called: name for name, called in wish.names.items()}  # checks call cameras as shown
    changes: dict[str, Any] = {}
    room: dict[str, Any] = {}
    for remedy in remedies:
        flag, value = remedy.flag.removeprefix("--"), remedy.value
        if flag in ("pose", "axes", "up") or (flag == "unit" and value in METRES):
            changes[flag] = value
        elif flag == "boxes":
            layout, _, normalised = value.partition("-")
            changes |= {"boxes": layout, "normalised": True if normalised else None}
        elif flag == "euler":
            changes["turns"] = value
        elif flag == "accept-best":
            changes["accept_best"] = True
        elif flag == "first-index":
            changes["first_index"] = int(value)
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
