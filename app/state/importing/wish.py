"""What somebody wishes of an import: the name, and what is known better than the files say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pydantic import ConfigDict, Field

from app.described import Described
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
from tracker.sequences.finding import Remedy

if TYPE_CHECKING:
    from tracker.io.importing.gathering import ParsedFiles


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
