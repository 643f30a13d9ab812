"""Suggested templates: boxes of people on whose places several cameras agree.

No function of this module changes a run, and no run depends on its bounds: the user accepts or
rejects each suggestion.
"""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from numpy import ndarray

from tracker.fusion.trajectories import Trajectories
from tracker.geometry.boxes import Boxes, paired_overlaps
from tracker.geometry.camera import Camera
from tracker.parameters.groups.colour_phd import ColourPhdParams
from tracker.runs.run import Run
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence, Template
from tracker.single_view.colour.templates import read_templates, template_picture
from tracker.single_view.pictures import colour
from tracker.steps.table import Table

# What these change was measured in the three built-in rooms and in the random rooms of seeds 1500
# and 1501, with all templates, one of each person and none: 84 boxes are suggested, each of the
# right person, as are all with the values below.
STEPS = 200
"""Largest number of steps that are considered; they are spread over the recording, since
neighbouring pictures look alike. Halved, 81 boxes are suggested; doubled 84."""

AGREE = 2
"""Least number of cameras that have a box of the person. With 1, 84 boxes are suggested, with 3
none before two cameras."""

LEAST_EXISTENCE = 0.95
"""Least existence probability of a track. With 0.5 and 0.99, 87 and 83 boxes are suggested."""

LEAST_LIFE = 1.0
"""Least length of a track, seconds; false tracks are short. Halved and without it, 84 boxes are
suggested, doubled 82."""

LARGEST_COVER = 0.05
"""Largest share of the area of a box that another person's box may cover. Halved and doubled, 84
boxes are suggested; without it 89."""

SMALLEST = 12.0
"""Least width and height of a box, pixels; the colour histogram of a smaller box has too few
pixels. Halved or doubled, 93 or 78 boxes are suggested."""

EACH = 3
"""Largest number of moments of a track that are considered in each camera. With 1, 2 and 6, 49, 82
and 84 boxes are suggested."""

ALIKE = 0.25
"""Bhattacharyya distance from a template of the same person in the same camera below which no box
is suggested. Halved, 84 are, doubled 39."""

CLEARER = 0.05
"""Least difference between a track's Bhattacharyya distances to the templates of the nearest person
and to those of the next one, if the track is assigned to the nearest. From 0 to 0.1, 84 boxes are
suggested."""

MOST = 2
"""Largest number of templates of a person in a camera, including those that exist. With 1 and 4, 38
and 143 boxes are suggested."""

ON_TEMPLATE = 0.4
"""Least intersection over union of a template and a track's box if the track is assigned to the
template's person. Halved, 84 boxes are suggested; doubled 74."""

_NUMBERS = ColourPhdParams()
"""The colour space, the kernel of histograms and the acceptance distance by default."""


@dataclass(frozen=True, slots=True, eq=False)
class Moments(Table):
    """M moments at which a camera shows a person well: the place is known, the box is whole and
    not covered."""

    tracks: Int[ndarray, " M"]
    """The id of the track."""
    cameras: Int[ndarray, " M"]
    """The index of the camera."""
    steps: Int[ndarray, " M"]
    """The step, counted from 0."""
    boxes: Float[ndarray, "M 4"]
    """Left, top, width, height in pixels, of a box drawn around an upright target."""
    own: Bool[ndarray, " M"]
    """Whether the camera itself has a box of the person."""
    agreeing: Bool[ndarray, "M C"]
    """Whether each of the C cameras has a box of the person."""
    deviations: Float[ndarray, " M"]
    """Standard deviation of the place on the floor, metres."""

    @staticmethod
    def none(cameras: int) -> Moments:
        """Return no moments."""
        whole, real = np.zeros(0, dtype=np.int64), np.zeros(0)
        agreeing = np.zeros((0, cameras), dtype=bool)
        own = np.zeros(0, dtype=bool)
        return Moments(whole, whole, whole, np.zeros((0, 4)), own, agreeing, real)

    def __len__(self) -> int:
        return len(self.tracks)


def drawn_boxes(
    camera: Camera, positions: Float[ndarray, "N 3"], half_extents: Float[ndarray, " 3"]
) -> Float[ndarray, "N 4"]:
    """Return the bounding boxes of upright targets, as a person would draw them.

    The outline of a person is closer to an ellipse than to the box of a target. With the half axes
    a (across the person) and b (along the person) of the ellipse in pixels, half width W and half
    height H of its bounding box are

        W² = a_x² + b_x²,  H² = a_y² + b_y²

    Args:
        camera: The calibrated camera.
        positions: The positions of the targets, world metres.
        half_extents: Half width, depth and height of a target, metres.

    Returns:
        Left, top, width, height in pixels, not clipped to the picture; NaN behind the camera.
    """
    right = camera.rotation[0] * [1.0, 1.0, 0.0]
    norm = float(np.linalg.norm(right))
    if norm < 0.5:  # the camera is rolled by about 90°
        right = camera.rotation[1] * [1.0, 1.0, 0.0]
        norm = float(np.linalg.norm(right))
    across = right / max(norm, 1e-9) * half_extents[:2].mean()
    up = np.array([0.0, 0.0, half_extents[2]])
    ends = np.stack([positions - across, positions + across, positions - up, positions + up])
    pixels, valid = camera.project(ends.reshape(-1, 3))
    left, end, low, high = pixels.reshape(4, -1, 2)
    reach = np.hypot(end - left, high - low) / 2.0
    boxes = Boxes(np.concatenate([(low + high) / 2.0, reach], axis=1)).left_top
    boxes[~valid.reshape(4, -1).all(axis=0)] = np.nan
    return boxes


def best_moments(run: Run) -> Moments:
    """Return the best moments of every track in every camera, the best of each first.

    The moments are those at which the track is long enough and has a high existence probability,
    the standard deviation of its place is at most half a target's width, at least :data:`AGREE`
    cameras have a box of the person, and the upright box lies within the picture and is not covered
    by another box. Moments at which the camera itself has a box come first, then those with more
    agreeing cameras, then larger boxes.

    Args:
        run: A complete run.
    """
    sequence, tracks = run.sequence, _considered(run)
    extents = sequence.target_half_extents
    deviations = tracks.sigmas[:, :2].max(axis=1, initial=0.0)
    sure = (tracks.existences >= LEAST_EXISTENCE) & (deviations <= extents[:2].mean())
    sure &= tracks.seen.sum(axis=1) >= AGREE
    sure &= np.isin(tracks.ids, _long_lived(run))
    found = []
    for index, view in enumerate(sequence.views):
        if not view.has_pictures:
            continue
        boxes = drawn_boxes(view.camera, tracks.positions, extents)
        rows = np.flatnonzero(sure & _whole(view.camera, boxes) & _apart(tracks.frames, boxes))
        found.append(
            Moments(
                tracks.ids[rows], np.full(len(rows), index), tracks.frames[rows], boxes[rows],
                tracks.seen[rows, index], tracks.seen[rows], deviations[rows],
            )
        )  # fmt: skip
    if not found:
        return Moments.none(len(sequence.views))
    return _best(Moments.concatenate(found), sequence.fps)


def _considered(run: Run) -> Trajectories:
    """Return the tracks at the steps that are considered."""
    tracks = run.tracks
    stride = -(-run.done // STEPS)
    return tracks.take((tracks.frames % max(stride, 1) == 0) & (tracks.frames < run.done))


def _long_lived(run: Run) -> Int[ndarray, " n"]:
    """Return the ids of the tracks that are long enough."""
    ids, counts = np.unique(run.tracks.ids, return_counts=True)
    return np.asarray(ids[counts >= min(LEAST_LIFE * run.sequence.fps, run.done)])


def _whole(camera: Camera, boxes: Float[ndarray, "N 4"]) -> Bool[ndarray, " N"]:
    """Whether each box lies within the picture and is large enough."""
    with np.errstate(invalid="ignore"):
        inside = (boxes[:, :2] >= -0.5).all(axis=1)
        inside &= (boxes[:, :2] + boxes[:, 2:] <= np.array(camera.image_size) - 0.5).all(axis=1)
        return np.asarray(inside & (boxes[:, 2:] >= SMALLEST).all(axis=1))


def _apart(frames: Int[ndarray, " N"], boxes: Float[ndarray, "N 4"]) -> Bool[ndarray, " N"]:
    """Whether each box is covered by at most :data:`LARGEST_COVER` by each other box of its
    step."""
    apart = np.ones(len(frames), dtype=bool)
    for rows in np.split(np.arange(len(frames)), np.flatnonzero(np.diff(frames)) + 1):
        own = boxes[rows]
        low = np.maximum(own[:, None, :2], own[None, :, :2])
        high = np.minimum((own[:, :2] + own[:, 2:])[:, None], (own[:, :2] + own[:, 2:])[None])
        shared = np.maximum(high - low, 0.0).prod(axis=2) / own[:, None, 2:].prod(axis=2)
        np.fill_diagonal(shared, 0.0)
        # boxes behind the camera are NaN and cover nothing
        apart[rows] = (np.nan_to_num(shared) <= LARGEST_COVER).all(axis=1)
    return apart


def _best(found: Moments, fps: float) -> Moments:
    """Select at most :data:`EACH` moments of every track and camera, at least a second apart."""
    order = np.lexsort(
        (-found.boxes[:, 3], -found.agreeing.sum(axis=1), ~found.own, found.cameras, found.tracks)
    )
    chosen: list[int] = []
    already: dict[tuple[int, int], list[int]] = {}
    for row in order.tolist():
        own = already.setdefault((int(found.tracks[row]), int(found.cameras[row])), [])
        step = int(found.steps[row])
        if len(own) < EACH and all(abs(step - other) >= fps for other in own):
            own.append(step)
            chosen.append(row)
    return found.take(np.array(chosen, dtype=np.int64))


@dataclass(frozen=True, slots=True, eq=False)
class Suggestion:
    """A template that is suggested to the user."""

    template: Template
    """The template: person, camera, step and box."""
    track: int
    """The id of the person's track."""
    cameras: tuple[str, ...]
    """The names of the cameras that have a box of the person at the moment."""
    deviation: float
    """Standard deviation of the place of the person on the floor, metres."""
    difference: float | None
    """Bhattacharyya distance to the nearest template of the person; None if the person has none."""
    known_here: bool
    """Whether the person has a template in this camera already."""
    own: bool
    """Whether the camera itself has a box of the person; if not, only other cameras have."""

    @property
    def reason(self) -> str:
        """The reason for the suggestion, in a few words."""
        who = f"{len(self.cameras)} cameras agree"
        if not self.own:
            who += ", this one finds nobody"
        if self.difference is None:
            look = "nobody's template yet"
        else:
            look = "another look" if self.known_here else "the first of this camera"
            look += f", {self.difference:.2f} from the nearest"
        return f"{who}, ± {self.deviation:.2f} m; {look}"


def suggest_templates(run: Run, pictures: Pictures) -> tuple[Suggestion, ...]:
    """Suggest templates where a person has no template in a camera, or none of a similar
    appearance.

    A track is assigned to the person whose template overlaps its box, or else to the person whose
    templates have the least median Bhattacharyya distance to its boxes over its moments. If no
    distance is below :attr:`ColourPhdParams.acceptance_distance`, the track is a new person; if two
    people are about equally near, it is left out. A box is left out if it is nearer to another
    person's templates, or near a template of the person in the same camera.

    Args:
        run: A complete run.
        pictures: The pictures of its sequence, of which a few dozen are read.

    Returns:
        The suggestions by person and by camera, the best first.
    """
    found = best_moments(run)
    found, appearances = _appearances(found, pictures)
    templates = run.sequence.templates
    known = _known(run.sequence, pictures)
    names = _names(run, found, appearances, known)
    suggestions: list[Suggestion] = []
    there: dict[tuple[str, int], list[ndarray]] = {}
    cameras = [camera.name for camera in run.sequence.cameras]
    for one, root in zip(templates, known, strict=True):
        if one.camera in cameras:
            there.setdefault((one.name, cameras.index(one.camera)), []).append(root)
    for row in range(len(found)):
        name = names.get(int(found.tracks[row]))
        if name is None:
            continue
        place = (name, int(found.cameras[row]))
        already = there.setdefault(place, [])
        if len(already) >= MOST or (_distances(appearances[row], already) < ALIKE).any():
            continue
        mine = [r for t, r in zip(templates, known, strict=True) if t.name == name]
        others = [r for t, r in zip(templates, known, strict=True) if t.name != name]
        nearest = float(_distances(appearances[row], mine).min(initial=1.0))
        if _distances(appearances[row], others).min(initial=1.0) < nearest:
            continue
        already.append(appearances[row])
        suggestions.append(
            Suggestion(
                Template(name, cameras[place[1]], int(found.steps[row]), found.boxes[row].round(1)),
                int(found.tracks[row]),
                tuple(np.array(cameras)[found.agreeing[row]].tolist()),
                float(found.deviations[row]),
                nearest if mine else None,
                any(t.name == name and t.camera == cameras[place[1]] for t in templates),
                bool(found.own[row]),
            )
        )
    suggested = [one.template.name for one in suggestions]
    order = list(dict.fromkeys([*(t.name for t in templates), *suggested]))
    return tuple(
        sorted(
            suggestions,
            key=lambda s: (order.index(s.template.name), cameras.index(s.template.camera)),
        )
    )


def without_templates(suggestions: Iterable[Suggestion], sequence: Sequence) -> list[Suggestion]:
    """Return the suggestions that are not templates of the sequence yet."""
    accepted = {(one.camera, one.frame, one.box.tobytes()) for one in sequence.templates}
    return [
        one
        for one in suggestions
        if (one.template.camera, one.template.frame, one.template.box.tobytes()) not in accepted
    ]


def _appearances(found: Moments, pictures: Pictures) -> tuple[Moments, Float[ndarray, "M bins"]]:
    """Return the moments whose picture can be read, and the element-wise square roots of their
    colour histograms."""
    kept, roots = [], []
    order = np.lexsort((found.steps, found.cameras))  # videos are read forwards
    for row in order.tolist():
        pictures.check()
        picture = template_picture(pictures, int(found.cameras[row]), int(found.steps[row]))
        if picture is not None:
            kept.append(row)
            roots.append(_root(picture, found.boxes[row]))
    back = np.argsort(kept)
    appearances = np.array(roots).reshape(-1, colour.BINS[_NUMBERS.colour_space])
    return found.take(np.array(kept, dtype=np.int64)[back]), appearances[back]


def _root(picture: ndarray, box: Float[ndarray, " 4"]) -> Float[ndarray, " bins"]:
    """Return the element-wise square root of the colour histogram of a box of a picture.

    Args:
        picture: The picture.
        box: Left, top, width, height in pixels.
    """
    space, kernel = _NUMBERS.colour_space, _NUMBERS.histogram_kernel
    place = Boxes.from_left_top(box[None]).centred
    (histogram,) = colour.histograms(colour.bin_map(picture, space), place, space, kernel)
    return np.asarray(np.sqrt(histogram))


def _known(sequence: Sequence, pictures: Pictures) -> list[Float[ndarray, " bins"]]:
    """Return the element-wise square root of each template's histogram."""
    if not sequence.templates:
        return []
    model = read_templates(sequence, _NUMBERS.colour_space, _NUMBERS.histogram_kernel, pictures)
    return list(model.roots)


def _distances(root: Float[ndarray, " bins"], known: Many[ndarray]) -> Float[ndarray, " n"]:
    """Compute the Bhattacharyya distance of a histogram from n others, all given by their
    element-wise square roots."""
    roots = np.array(known).reshape(-1, len(root))
    return np.asarray(np.sqrt(np.clip(1.0 - roots @ root, 0.0, 1.0)))


def _names(
    run: Run, found: Moments, appearances: Float[ndarray, "M bins"], known: list[ndarray]
) -> dict[int, str]:
    """Return the name of each track's person; ambiguous tracks are left out.

    Args:
        run: The run.
        found: The moments of all tracks.
        appearances: The element-wise square root of the histogram at each moment.
        known: The element-wise square root of each template's histogram.
    """
    people = list(dict.fromkeys(one.name for one in run.sequence.templates))
    owners = [people.index(one.name) for one in run.sequence.templates]
    stands = _on_templates(run)
    names: dict[int, str] = {}
    used = set(people)
    for track in dict.fromkeys(found.tracks.tolist()):
        if track in stands:
            names[track] = stands[track]
            continue
        rows = np.flatnonzero(found.tracks == track)
        distances = np.ones((len(rows), len(people)))
        for own, row in enumerate(rows.tolist()):
            for owner, distance in zip(owners, _distances(appearances[row], known), strict=True):
                distances[own, owner] = min(distances[own, owner], distance)
        nearest = np.median(distances, axis=0)
        order = np.argsort(nearest)
        if not len(people) or nearest[order[0]] > _NUMBERS.acceptance_distance:
            name = next(word for k in range(1, 10_000) if (word := f"person{k}") not in used)
            used.add(name)
            names[track] = name
        elif len(people) == 1 or nearest[order[1]] - nearest[order[0]] >= CLEARER:
            names[track] = people[order[0]]
    return names


def _on_templates(run: Run) -> dict[int, str]:
    """Return the person of each track whose box overlaps a template."""
    sequence, tracks = run.sequence, run.tracks
    cameras = [camera.name for camera in sequence.cameras]
    votes: dict[int, list[str]] = {}
    for one in sequence.templates:
        rows = np.arange(len(tracks))[tracks.at(one.frame)]
        if one.camera not in cameras or not len(rows):
            continue
        drawn = drawn_boxes(
            sequence.cameras[cameras.index(one.camera)],
            tracks.positions[rows],
            sequence.target_half_extents,
        )
        overlaps = np.nan_to_num(paired_overlaps(drawn, one.box[None]))
        best = int(overlaps.argmax())
        if overlaps[best] >= ON_TEMPLATE:
            votes.setdefault(int(tracks.ids[rows[best]]), []).append(one.name)
    return {track: max(set(names), key=names.count) for track, names in votes.items()}
