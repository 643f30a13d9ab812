"""The cameras of all calibration files: lenses and poses put together, one set chosen."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tracker.io.importing.finding.names import match, short_names
from tracker.io.importing.gathering import ParsedFiles
from tracker.io.read.pieces import CalibrationPiece, FormatError, RawCamera

MOST_CAMERAS = 1000
"""Of one file; Panoptic Studio has 521."""


@dataclass(frozen=True, slots=True, eq=False)
class CameraSet:
    """Cameras that belong together: of one file, or of one folder with a file a camera."""

    label: str
    format: str
    cameras: tuple[RawCamera, ...]
    sources: frozenset[Path]
    """The files that the cameras are of."""
    incomplete: tuple[str, ...] = ()
    """Names of cameras that their file has too, without a lens or without a pose."""

    @property
    def posed(self) -> bool:
        """Whether every camera has a pose."""
        return all(camera.has_pose for camera in self.cameras)

    @property
    def lensed(self) -> bool:
        """Whether every camera has a lens."""
        return all(camera.has_lens for camera in self.cameras)


def camera_sets(taken: Sequence[ParsedFiles]) -> tuple[list[CameraSet], list[str]]:
    """Complete sets of cameras, and what is told of the others.

    Returns:
        Sets whose cameras all have a lens and a pose, the one with the most cameras first; and
        a sentence for each file whose lenses or poses found no counterpart.

    Raises:
        FormatError: If two cameras of one set have the same name, or a file has too many.
    """
    sets = _sets(taken)
    complete = [one for one in sets if one.posed and one.lensed]
    lenses = [one for one in sets if one.lensed and not one.posed]
    poses = [one for one in sets if one.posed and not one.lensed]
    told: list[str] = []
    used: set[str] = set()
    for pose in poses:
        joined = [found for lens in lenses if (found := _join(pose, lens)) is not None]
        if not joined:
            told.append(
                f"{pose.label}: has poses, but no file has the lenses of these cameras: K, a focal "
                "length in pixels or with the sensor's width, or an angle called fov_x or fov_y"
            )
            continue
        # of several, the one that comes last by its name
        complete.append(joined[-1])
        used |= {lens.label for lens in lenses if lens.label in joined[-1].label}
        told += [
            f"{one.label}: are other lenses of the same cameras; name only one of both to use it"
            for one in joined[:-1]
        ]
    for one in sets:
        if one in complete or one in poses or one.label in used:
            continue
        whole = _whole(one)
        if whole is not None:
            complete.append(whole)
            told += _lacking(one, whole)
        elif one in lenses:
            if not any(f"{one.label}: " in sentence for sentence in told):
                told.append(f"{one.label}: has lenses, but no file has the poses of these cameras")
        else:
            told.append(_mixed(one))
    for one in complete:
        names = [camera.name for camera in one.cameras]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise FormatError(f'{one.label}: two cameras have the name "{twice}"; rename one')
    return sorted(complete, key=lambda one: -len(one.cameras)), told


def _whole(one: CameraSet) -> CameraSet | None:
    """The cameras of a set that have a lens and a pose, where these are at least two."""
    whole = tuple(c for c in one.cameras if c.has_pose and c.has_lens)
    incomplete = tuple(c.name for c in one.cameras if c not in whole)
    return replace(one, cameras=whole, incomplete=incomplete) if len(whole) > 1 else None


def _lacking(one: CameraSet, whole: CameraSet) -> list[str]:
    """What the other cameras of a set lack, a sentence for each kind."""
    lacking: dict[str, list[str]] = {}
    for camera in one.cameras:
        if camera not in whole.cameras:
            posed, lensed = camera.has_pose, camera.has_lens
            what = "no pose" if lensed else "no lens" if posed else "neither lens nor pose"
            lacking.setdefault(what, []).append(camera.name)
    return [
        f"{one.label}: {', '.join(names)}: {what}, unlike the others; left out with the boxes and "
        "pictures"
        for what, names in lacking.items()
    ]


def _mixed(one: CameraSet) -> str:
    """Why a set of which some cameras have but a lens, and others but a pose, is of no use."""
    posed = Counter(camera.name for camera in one.cameras if camera.has_pose)
    name, count = posed.most_common(1)[0] if posed else ("", 0)
    if count > 1:
        return (
            f'{one.label}: has {count} poses of "{name}", expected one of each camera; '
            "leave those of other recordings out"
        )
    lacking = [camera.name for camera in one.cameras if not camera.has_lens]
    return f"{one.label}: some cameras have no lens, others no pose ({', '.join(lacking[:3])} …)"


def _sets(taken: Sequence[ParsedFiles]) -> list[CameraSet]:
    """Files with several cameras each, and the files of a folder with one camera each."""
    sets: list[CameraSet] = []
    single: dict[tuple[str, str, bool], list[tuple[str, Path, RawCamera]]] = {}
    beside = _in_a_folder_each(taken)
    for one in taken:
        for piece in one.pieces:
            if not isinstance(piece, CalibrationPiece) or not piece.cameras:
                continue
            if len(piece.cameras) > MOST_CAMERAS:
                raise FormatError(
                    f"{one.label}: has {len(piece.cameras):,} cameras, expected at most "
                    f"{MOST_CAMERAS}; leave out those of other recordings"
                )
            if len(piece.cameras) > 1:
                own = frozenset({piece.source})
                sets.append(CameraSet(one.label, piece.format, piece.cameras, own))
                continue
            camera = piece.cameras[0]
            key = (_place(piece.source, beside), piece.format, camera.has_pose)
            single.setdefault(key, []).append((one.label, piece.source, camera))
    for (_, format_, _), rows in single.items():
        labels = [label.rsplit(".", 1)[0] for label, _, _ in rows]
        given = [camera.name for _, _, camera in rows]
        stated = len(set(given)) == len(given) and all(given)
        names = given if stated else short_names(labels)
        cameras = tuple(
            replace(camera, name=name) for name, (_, _, camera) in zip(names, rows, strict=True)
        )
        label = rows[0][0] if len(rows) == 1 else f"{rows[0][0]} … ({len(rows)})"
        sources = frozenset(source for _, source, _ in rows)
        sets.append(CameraSet(label, format_, cameras, sources))
    return sets


def _in_a_folder_each(taken: Sequence[ParsedFiles]) -> set[tuple[Path, str]]:
    """Names of files that lie in several folders beside each other: a camera a folder."""
    sources = [
        piece.source
        for one in taken
        for piece in one.pieces
        if isinstance(piece, CalibrationPiece) and len(piece.cameras) == 1
    ]
    kinds = Counter((source.parent, _without_numbers(source.name)) for source in sources)
    folders = Counter((folder.parent, name) for (folder, name), n in kinds.items() if n == 1)
    return {kind for kind, count in folders.items() if count > 1}


def _place(source: Path, beside: set[tuple[Path, str]]) -> str:
    """Where the other cameras' files of the same kind are."""
    kind = (source.parent.parent, _without_numbers(source.name))
    return f"{kind[0]}/*/{kind[1]}" if kind in beside else str(source.parent)


def _without_numbers(name: str) -> str:
    return re.sub(r"\d+", "#", name)


def _join(pose: CameraSet, lens: CameraSet) -> CameraSet | None:
    """Each pose with its lens, where every pose finds one."""
    names = [camera.name for camera in lens.cameras]
    found = match(names, [camera.name for camera in pose.cameras])
    if found is None or len(found[0]) < len(pose.cameras):
        return None
    cameras = tuple(
        camera.with_lens_of(lens.cameras[found[0][n]]) for n, camera in enumerate(pose.cameras)
    )
    sources = pose.sources | lens.sources
    return CameraSet(f"{pose.label} with {lens.label}", pose.format, cameras, sources)
