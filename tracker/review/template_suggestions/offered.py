"""What templates a run offers, and of whom."""

from __future__ import annotations

from collections.abc import Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.geometry.boxes import Boxes, paired_overlaps
from tracker.parameters import ColourPhdParams
from tracker.review.template_suggestions.candidates import Moments, drawn_boxes, moments
from tracker.runs.run import Run
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence, Template
from tracker.single_view.colour.templates import read_templates, template_picture
from tracker.single_view.pictures import colour

ALIKE = 0.25
"""Bhattacharyya distance below which a box shows nothing that a template of the same person in
the same camera does not show."""

CLEARER = 0.05
"""By how much nearer a track's boxes must be to one person's templates than to another's."""

MOST = 2
"""Templates of a person in a camera that are enough, those already there counted."""

ON_TEMPLATE = 0.4
"""Intersection over union of a template with a track's box from which the track is its person."""

_NUMBERS = ColourPhdParams()


@dataclass(frozen=True, slots=True, eq=False)
class Offer:
    """A template that a person may take."""

    template: Template
    track: int
    """Id of the track that it was cut from."""
    cameras: tuple[str, ...]
    """Whose boxes are the person's at the moment."""
    deviation: float
    """Standard deviation of the place on the floor, metres."""
    difference: float | None
    """Bhattacharyya distance to the nearest template of the person; None where there is none."""
    known_here: bool
    """Whether the person has a template of this camera already."""
    own: bool
    """Whether the camera itself has a box of the person; where not, it is the others' word."""

    @property
    def reason(self) -> str:
        """Why it is offered, in a few words."""
        who = f"{len(self.cameras)} cameras agree"
        if not self.own:
            who += ", this one finds nobody"
        if self.difference is None:
            look = "nobody's template yet"
        else:
            look = "another look" if self.known_here else "the first of this camera"
            look += f", {self.difference:.2f} from the nearest"
        return f"{who}, ± {self.deviation:.2f} m; {look}"


def offered(run: Run, pictures: Pictures) -> tuple[Offer, ...]:
    """Boxes of people whom several cameras agree about, in cameras or looks without a template.

    A track is the person in whose template it stands, or else whose templates its boxes are
    nearest to, by the median over its moments of the Bhattacharyya distance; no nearer to any than
    :attr:`ColourPhdParams.acceptance_distance` it is somebody new, and between two nobody's. A
    box that looks more like another person is left out, and one that looks like a template that
    the person already has in that camera.

    Args:
        run: With all its steps.
        pictures: Of its sequence; a few dozen are read.

    Returns:
        Person by person and camera by camera, the best first.
    """
    found = moments(run)
    found, looks = _looks(found, pictures)
    templates = run.sequence.templates
    known = _known(run.sequence, pictures)
    names = _names(run, found, looks, known)
    offers: list[Offer] = []
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
        if len(already) >= MOST or (_distances(looks[row], already) < ALIKE).any():
            continue
        mine = [r for t, r in zip(templates, known, strict=True) if t.name == name]
        others = [r for t, r in zip(templates, known, strict=True) if t.name != name]
        nearest = float(_distances(looks[row], mine).min(initial=1.0))
        if _distances(looks[row], others).min(initial=1.0) < nearest:
            continue
        already.append(looks[row])
        offers.append(
            Offer(
                Template(name, cameras[place[1]], int(found.steps[row]), found.boxes[row].round(1)),
                int(found.tracks[row]),
                tuple(np.array(cameras)[found.agreeing[row]].tolist()),
                float(found.deviations[row]),
                nearest if mine else None,
                any(t.name == name and t.camera == cameras[place[1]] for t in templates),
                bool(found.own[row]),
            )
        )
    order = list(dict.fromkeys([*(t.name for t in templates), *(o.template.name for o in offers)]))
    return tuple(
        sorted(
            offers,
            key=lambda o: (order.index(o.template.name), cameras.index(o.template.camera)),
        )
    )


def untaken(offers: Iterable[Offer], sequence: Sequence) -> list[Offer]:
    """The offers that are no template of the sequence yet."""
    taken = {(one.camera, one.frame, one.box.tobytes()) for one in sequence.templates}
    return [
        one
        for one in offers
        if (one.template.camera, one.template.frame, one.template.box.tobytes()) not in taken
    ]


def _looks(found: Moments, pictures: Pictures) -> tuple[Moments, Float[ndarray, "M bins"]]:
    """Those whose picture is there, with the roots of their colour histograms."""
    kept, roots = [], []
    order = np.lexsort((found.steps, found.cameras))  # a film is read forwards
    for row in order.tolist():
        pictures.check()
        picture = template_picture(pictures, int(found.cameras[row]), int(found.steps[row]))
        if picture is not None:
            kept.append(row)
            roots.append(_root(picture, found.boxes[row]))
    back = np.argsort(kept)
    looks = np.array(roots).reshape(-1, colour.BINS[_NUMBERS.colour_space])
    return found.take(np.array(kept, dtype=np.int64)[back]), looks[back]


def _root(picture: ndarray, box: Float[ndarray, " 4"]) -> Float[ndarray, " bins"]:
    space, kernel = _NUMBERS.colour_space, _NUMBERS.histogram_kernel
    place = Boxes.from_left_top(box[None]).centred
    (histogram,) = colour.histograms(colour.bin_map(picture, space), place, space, kernel)
    return np.asarray(np.sqrt(histogram))


def _known(sequence: Sequence, pictures: Pictures) -> list[Float[ndarray, " bins"]]:
    """The roots of the templates' histograms, in their order."""
    if not sequence.templates:
        return []
    model = read_templates(sequence, _NUMBERS.colour_space, _NUMBERS.histogram_kernel, pictures)
    return list(model.roots)


def _distances(look: Float[ndarray, " bins"], known: Many[ndarray]) -> Float[ndarray, " n"]:
    """Bhattacharyya distances of a box to templates."""
    roots = np.array(known).reshape(-1, len(look))
    return np.asarray(np.sqrt(np.clip(1.0 - roots @ look, 0.0, 1.0)))


def _names(
    run: Run, found: Moments, looks: Float[ndarray, "M bins"], known: list[ndarray]
) -> dict[int, str]:
    """Whose each track is; those of whom that is not clear are left out."""
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
        told = np.ones((len(rows), len(people)))
        for own, row in enumerate(rows.tolist()):
            for owner, distance in zip(owners, _distances(looks[row], known), strict=True):
                told[own, owner] = min(told[own, owner], distance)
        nearest = np.median(told, axis=0)
        order = np.argsort(nearest)
        if not len(people) or nearest[order[0]] > _NUMBERS.acceptance_distance:
            name = next(word for k in range(1, 10_000) if (word := f"person{k}") not in used)
            used.add(name)
            names[track] = name
        elif len(people) == 1 or nearest[order[1]] - nearest[order[0]] >= CLEARER:
            names[track] = people[order[0]]
    return names


def _on_templates(run: Run) -> dict[int, str]:
    """The tracks that stand in somebody's template, and whose."""
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
    return {track: max(set(told), key=told.count) for track, told in votes.items()}
