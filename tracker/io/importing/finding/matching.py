"""Pictures and boxes of each camera, by names, numbers, order and the size of the pictures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from tracker.io.conventions.questions import ACCEPT
from tracker.io.importing.finding.calibrations import CameraSet
from tracker.io.importing.finding.names import How, match, words_of
from tracker.io.importing.gathering import ParsedFiles
from tracker.io.importing.options import ImportOptions
from tracker.io.read.pieces import (
    DetectionPiece,
    FormatError,
    ImagesPiece,
    RawCamera,
    TimesPiece,
    TruthPiece,
    VideoPiece,
)

ASPECT_TOLERANCE = 0.01
"""By how much a picture's width by height may differ from the calibration's: rounding."""

_NAMED = 8
"""Files or cameras that a sentence names one by one."""

_LAST_CHOICE = ("ground truth",)
"""Formats whose boxes are annotations: taken where no detector's are there."""


@dataclass(slots=True, eq=False)
class MatchedCamera:
    """One camera with what belongs to it."""

    raw: RawCamera
    calibration_of: str
    """The camera whose calibration it has by its file: its own, unless they are exchanged."""
    video: VideoPiece | None = None
    images: ImagesPiece | None = None
    detections: DetectionPiece | None = None
    times: TimesPiece | None = None
    how: dict[str, How] = field(default_factory=dict)
    """How its pictures and boxes were matched."""

    def files_by(self, how: How) -> list[Path]:
        """The files, or folders of pictures, that were matched in this way."""
        pictures = self.video.path if self.video else self.images.folder if self.images else None
        boxes = None if self.detections is None else self.detections.source
        files = {"pictures": pictures, "detections": boxes}
        return [file for kind, file in files.items() if file and self.how.get(kind) == how]

    @property
    def picture_size(self) -> tuple[int, int] | None:
        """Of video or images; else what the boxes' file says."""
        if self.video is not None:
            return self.video.size
        if self.images is not None:
            return self.images.size
        return None if self.detections is None else self.detections.image_size


@dataclass(slots=True, eq=False)
class Matched:
    """All cameras with what belongs to them, and what belongs to none."""

    cameras: list[MatchedCamera]
    format: str
    """Of their calibration."""
    truths: list[tuple[str, TruthPiece]]
    told: list[str]
    """Sentences about what is not used."""
    sources: frozenset[Path]
    """The files of the calibration."""
    spare: list[MatchedCamera] = field(default_factory=list)
    """Cameras of the calibration without any file."""


def matched_by(cameras: Sequence[MatchedCamera]) -> How:
    """By what the boxes of cameras were matched, the weakest of all."""
    ways = {camera.how.get("detections", "name") for camera in cameras}
    return "order" if "order" in ways else "number" if "number" in ways else "name"


def match_all(
    taken: Sequence[ParsedFiles],
    sets: Sequence[CameraSet],
    options: ImportOptions,
    incomplete: Sequence[str] = (),
) -> Matched:
    """Give every camera its video or pictures and its boxes.

    Cameras with neither are left out where others have some.

    Args:
        taken: All files.
        sets: Cameras with lens and pose.
        options: What is told.
        incomplete: Why other cameras are of no use.

    Raises:
        FormatError: If a flag names a camera or a file that is not there.
    """
    told: list[str] = []
    videos, detections, truths = _by_kind(taken)
    complaints = [*incomplete, *(t.complaint for t in taken if t.complaint and not t.pieces)]
    labels = [label for label, _ in videos] or [label for label, _ in detections]
    chosen = _choose(sets, labels, complaints)
    for other in sets:
        if other is not chosen:
            told.append(f"{other.label}: is another calibration; it is not used")
    cameras = [MatchedCamera(raw, raw.name) for raw in chosen.cameras]
    _by_flag(cameras, videos, detections, options)
    _match_pictures(cameras, videos, chosen.incomplete, told)
    _match_boxes(cameras, detections, _spoilt(taken), chosen.incomplete, told)
    _match_times(cameras, _times(taken), told)
    _exchange(cameras, options)
    wanted = [c for c in cameras if c.raw.name not in options.left_out]
    if not wanted:
        raise FormatError("every camera is left out; expected at least one that is not")
    cameras = wanted
    used = [c for c in cameras if c.video or c.images or c.detections is not None]
    lost = [c.detections.left_out for c in used if c.detections and not len(c.detections.frames)]
    if len(lost) == len(used) and any(lost) and not any(c.video or c.images for c in used):
        raise FormatError(f"no box of a person is left in any camera: {next(filter(None, lost))}")
    if used and len(used) < len(cameras):
        if not options.accept_best:
            _check_read([c.raw.name for c in cameras if c not in used], taken)
        left = [c.raw.name for c in cameras if c not in used]
        told.append(
            f"{len(left)} cameras of {chosen.label} have neither video nor boxes and are left out: "
            f"{first_of(left)}"
        )
    spare = [c for c in cameras if used and c not in used]
    return Matched(used or cameras, chosen.format, truths, told, chosen.sources, spare)


def _check_read(names: Sequence[str], taken: Sequence[ParsedFiles]) -> None:
    """Check that no table of the cameras without files is mostly spoilt.

    Args:
        names: The cameras without files.
        taken: All files.

    Raises:
        FormatError: If most rows of a table that belongs to one of them cannot be read.
    """
    for one in taken:
        found = match(names, [one.label], by_order=False) if one.mostly_spoilt else None
        if found is not None:
            raise FormatError(
                f"{one.complaint}; so most of what {names[found[0][0]]} saw would be left out: get "
                f"the file again, or {ACCEPT} imports the other cameras alone"
            )


_Pictures = list[tuple[str, VideoPiece | ImagesPiece]]
_Boxes = list[tuple[str, DetectionPiece]]


def _by_kind(
    taken: Sequence[ParsedFiles],
) -> tuple[_Pictures, _Boxes, list[tuple[str, TruthPiece]]]:
    pictures: _Pictures = []
    boxes: _Boxes = []
    truths: list[tuple[str, TruthPiece]] = []
    cameras: dict[str, list[str]] = {}
    for one in taken:
        for piece in one.pieces:
            if isinstance(piece, DetectionPiece):
                cameras.setdefault(piece.format, []).append(piece.camera)
    # what all files of a format call their camera, such as "frame", tells none from another
    alike = {form for form, own in cameras.items() if len(own) > 1 and len(set(own)) == 1}
    for one in taken:
        for piece in one.pieces:
            label = one.label.split(" … ")[0].rsplit(".", 1)[0]
            if isinstance(piece, VideoPiece | ImagesPiece):
                pictures.append((label, piece))
            elif isinstance(piece, DetectionPiece):
                own = "" if piece.format in alike else piece.camera
                boxes.append((own or _own_label(one, piece.source, label), piece))
            elif isinstance(piece, TruthPiece):
                truths.append((one.label, piece))
    return pictures, boxes, truths


def _own_label(one: ParsedFiles, source: Path, label: str) -> str:
    """Of a series whose files are a camera each, the label of this file."""
    if len(one.files) < 2 or len(one.pieces) < 2:
        return label
    return f"{label.rsplit('/', 1)[0]}/{source.stem}" if "/" in label else source.stem


def _choose(
    sets: Sequence[CameraSet], labels: Sequence[str], complaints: Sequence[str]
) -> CameraSet:
    """The calibration whose cameras have most of the files; the larger of two.

    Raises:
        FormatError: If there is none; with why a file that could have been one is not read.
    """
    if not sets:
        raise FormatError(
            "no calibration was found: expected one of OpenCV, Pose2Sim, Anipose, Caliscope, "
            "Qualisys, COLMAP … (`multiview-phd formats` lists them) with lens and pose of every "
            f"camera{''.join(f'; {complaint}' for complaint in complaints[:1])}"
        )

    def fitting(one: CameraSet) -> int:
        found = match([c.name for c in one.cameras], labels) if labels else None
        return 0 if found is None else len(found[0])

    return max(sets, key=lambda one: (fitting(one), len(one.cameras)))


def _by_flag(
    cameras: list[MatchedCamera], pictures: _Pictures, boxes: _Boxes, options: ImportOptions
) -> None:
    for name, path in options.cameras:
        own = [_named(cameras, name, "--camera")]
        wanted = path.resolve()
        found = False
        for row in [*pictures]:
            piece = row[1]
            place = piece.path if isinstance(piece, VideoPiece) else piece.folder
            if place.resolve() == wanted:
                pictures.remove(row)
                _give_pictures(own[0], piece, "name")
                found = True
        for box in [*boxes]:
            if wanted in (box[1].source.resolve(), box[1].source.parent.resolve()):
                boxes.remove(box)
                own[0].detections, own[0].how["detections"] = box[1], "name"
                found = True
        if not found:
            raise FormatError(
                f"--camera {name}={path}: is neither a video, nor a folder of pictures, nor boxes "
                "among what is imported; name it as a source too"
            )


def _named(cameras: Sequence[MatchedCamera], name: str, flag: str) -> MatchedCamera:
    for camera in cameras:
        if camera.raw.name == name:
            return camera
    known = ", ".join(camera.raw.name for camera in cameras)
    raise FormatError(f"{flag} {name}: expected a camera of the calibration: {known}")


def _exchange(cameras: list[MatchedCamera], options: ImportOptions) -> None:
    """Calibrations that are the other camera's; names stay with pictures and boxes."""
    for first, second in options.swap:
        one, other = (_named(cameras, name, "--swap") for name in (first, second))
        one.raw, other.raw = replace(other.raw, name=first), replace(one.raw, name=second)
        one.calibration_of, other.calibration_of = other.calibration_of, one.calibration_of


def _give_pictures(camera: MatchedCamera, piece: VideoPiece | ImagesPiece, how: How) -> None:
    if isinstance(piece, VideoPiece):
        camera.video = piece
    else:
        camera.images = piece
    camera.how["pictures"] = how


def _match_pictures(
    cameras: list[MatchedCamera],
    pictures: _Pictures,
    incomplete: Sequence[str],
    told: list[str],
) -> None:
    free = [c for c in cameras if c.video is None and c.images is None]
    labels = [label for label, _ in pictures]
    found = match([c.raw.name for c in free], labels) if labels and free else None
    if found is not None and found[1] == "order" and not _sizes_fit(free, pictures, found[0]):
        found = None
    pairs, how = found or ({}, "name")
    left = [label for place, (label, _) in enumerate(pictures) if place not in pairs]
    several = _in_folders_of(free, left)
    told += [
        f"{name}: has {len(own)} videos or folders of pictures ({', '.join(own[:3])}); join parts "
        f"of one recording into one file, or say which by --camera {name}=FILE"
        for name, own in several.items()
    ]
    explained = {label for own in several.values() for label in own}
    strangers = []
    for place, (label, piece) in enumerate(pictures):
        if place in pairs:
            _give_pictures(free[pairs[place]], piece, how)
        elif label not in explained:
            strangers.append(label)
    told += _of_no_camera(strangers, cameras, incomplete)


def _of_no_camera(
    labels: Sequence[str], cameras: Sequence[MatchedCamera], incomplete: Sequence[str]
) -> list[str]:
    """One sentence on all files that belong to no camera, nor to one that has no pose or lens, of
    which the calibration tells; none where there are none."""
    found = match(incomplete, labels, by_order=False) if incomplete and labels else None
    of_incomplete = found[0] if found is not None else {}
    labels = [label for place, label in enumerate(labels) if place not in of_incomplete]
    if not labels:
        return []
    known = first_of([camera.raw.name for camera in cameras])
    belong = "belongs" if len(labels) == 1 else "belong"
    return [
        f"{first_of(labels)}: {belong} to no camera of the calibration ({known}); "
        "--camera NAME=FILE"
    ]


def first_of(names: Sequence[str]) -> str:
    """The first names of a list, and whether there are more."""
    return f"{', '.join(names[:_NAMED])}{' …' if len(names) > _NAMED else ''}"


def _in_folders_of(cameras: Sequence[MatchedCamera], labels: Sequence[str]) -> dict[str, list[str]]:
    """Of pictures that belong to none, those of which several lie in the folder of a camera."""
    found: dict[str, list[str]] = {}
    for camera in cameras:
        own = words_of(camera.raw.name)
        there = [x for x in labels if any(words_of(part) == own for part in x.split("/")[:-1])]
        if len(there) > 1:
            found[camera.raw.name] = there
    return found


def _times(taken: Sequence[ParsedFiles]) -> list[tuple[str, TimesPiece]]:
    """Time stamps with what says of which camera they are."""
    return [
        (piece.camera or one.label.rsplit(".", 1)[0], piece)
        for one in taken
        for piece in one.pieces
        if isinstance(piece, TimesPiece)
    ]


def _match_times(
    cameras: list[MatchedCamera], times: list[tuple[str, TimesPiece]], told: list[str]
) -> None:
    """Time stamps of frames, where every one of them belongs to a camera that has pictures."""
    labels = [label for label, _ in times]
    found = match([c.raw.name for c in cameras], labels, by_order=False) if labels else None
    pairs = {} if found is None else found[0]
    for place, (label, piece) in enumerate(times):
        if place in pairs:
            cameras[pairs[place]].times = piece
        else:
            told.append(
                f"{piece.source.name}: its time stamps of {label} belong to no camera of the "
                "calibration; they are not used"
            )


def _sizes_fit(cameras: list[MatchedCamera], pictures: _Pictures, pairs: dict[int, int]) -> bool:
    for place, camera in pairs.items():
        size = cameras[camera].raw.image_size
        if size is not None and not same_aspect(size, pictures[place][1].size):
            return False
    return True


def same_aspect(one: tuple[int, int], other: tuple[int, int]) -> bool:
    """Whether two pictures have the same shape, as far as whole pixels tell."""
    return abs(one[0] * other[1] / (one[1] * other[0]) - 1.0) <= ASPECT_TOLERANCE


def _spoilt(taken: Sequence[ParsedFiles]) -> list[tuple[str, str]]:
    """Label and ending of each file that begins as something known but cannot be read."""
    return [
        (one.label.removesuffix(path.suffix), path.suffix)
        for one in taken
        if one.complaint and not one.pieces
        for path in one.files[:1]
    ]


def _match_boxes(
    cameras: list[MatchedCamera],
    boxes: _Boxes,
    spoilt: Sequence[tuple[str, str]],
    incomplete: Sequence[str],
    told: list[str],
) -> None:
    """Boxes of one format together; of several formats the one that serves most cameras.

    A file that cannot be read counts where its name belongs to a camera as those of the others do:
    without it the numbers and the order of the others would be those of other cameras.
    """
    families: dict[str, _Boxes] = {}
    for row in boxes:
        families.setdefault(row[1].format, []).append(row)
    free = [c for c in cameras if c.detections is None]
    results: list[tuple[int, bool, dict[int, int], How, _Boxes]] = []
    for format_, rows in families.items():
        labels = [label for label, _ in rows]
        endings = {piece.source.suffix for _, piece in rows}
        others = [label for label, ending in spoilt if ending in endings]
        found = match([c.raw.name for c in free], labels + others) if free and others else None
        if found is None or len(found[0]) < len(rows) + len(others):
            found = match([c.raw.name for c in free], labels) if free else None
        if found is None or (len(found[0]) < len(rows) and found[1] != "name"):
            found = _by_pictures(free, labels) or found
        if found is None and len(cameras) == len(rows) == 1:
            found = ({0: 0}, "order")
        annotated = any(word in format_ for word in _LAST_CHOICE)
        pairs, how = found or ({}, "name")
        results.append((len(pairs), not annotated, pairs, how, rows))
    results.sort(key=lambda result: (result[1] and result[0] > 0, result[0]), reverse=True)
    strangers = []
    for place, (_, _, pairs, how, rows) in enumerate(results):
        for n, (label, piece) in enumerate(rows):
            if n not in pairs:
                strangers.append(label)
            elif place:
                told.append(f"{label}: has boxes too ({piece.format}); they are not used")
            else:
                free[pairs[n]].detections = piece
                free[pairs[n]].how["detections"] = how
    told += _of_no_camera(strangers, cameras, incomplete)


def _by_pictures(
    cameras: list[MatchedCamera], labels: Sequence[str]
) -> tuple[dict[int, int], How] | None:
    """By the names of the videos, where these are not called as the calibration's cameras."""
    named: list[tuple[int, str]] = []
    for place, camera in enumerate(cameras):
        if camera.video is not None:
            named.append((place, camera.video.path.stem))
        elif camera.images is not None:
            named.append((place, camera.images.folder.name))
    found = match([name for _, name in named], labels) if named else None
    if found is None:
        return None
    return {label: named[camera][0] for label, camera in found[0].items()}, found[1]


def nothing_of(
    cameras: Sequence[MatchedCamera], taken: Sequence[ParsedFiles], told: Sequence[str]
) -> FormatError:
    """Why a calibration is alone: what is wrong with the file that could have been of a camera."""
    complaints = [one.complaint for one in taken if one.complaint and not one.pieces] or list(told)
    names = ", ".join(camera.raw.name for camera in cameras[:3])
    first = complaints[0] if complaints else f"the cameras are {names} …"
    return FormatError(
        "neither videos, pictures nor boxes of these cameras were found, and a calibration "
        f"alone has no steps; add them ({first})"
    )
