"""How far foreground and shape are to be believed about each person, by their templates.

Somebody who never leaves is learnt as background. A template is proof that a person
was there: where it lies on background, the foreground is wrong and not the template.
So it is with shapes: somebody who lies, or whose template nobody would take for a person, is
not found by shape.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from itertools import islice

import numpy as np
from jaxtyping import Float
from numpy import ndarray
from scipy.special import expit

from tracker.geometry.boxes import Boxes, box_overlaps
from tracker.parameters import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence, Template
from tracker.single_view.box_sizes import geometry
from tracker.single_view.colour.templates import template_picture
from tracker.single_view.pictures.foreground import box_shares, integral, learn
from tracker.single_view.shape.finder import ShapeFinder

PICTURES_BEFORE = 8
"""Before a template's, that are looked at for what moves."""

TEMPLATES_BY_SHAPE = 2
"""Of each person, that are looked at: each takes a moment before the first step."""

PASSED, OVERLAP = -1.5, 0.3
"""Log odds from which somebody is there by shape, and what two people there share at most."""

NOTHING, ENOUGH = 0.1, 0.3
"""Shares of foreground in a template's box: below the first the foreground knows nothing of the
person, from the second on it is believed. Boxes drawn by hand around people whom it sees hold
0.38 to 0.86."""


def template_trust(
    sequence: Sequence, camera_index: int, reader: Pictures, parameters: ForegroundParams
) -> dict[str, float]:
    """Trust in a camera's foreground about each person with templates, 0 … 1.

    It rises smoothly from 0 to 1 with the mean share f of foreground in the person's
    templates,

        t = 3 u² - 2 u³,  u = (f - f_0) / (f_1 - f_0) within 0 … 1.

    Who has no template in this camera is judged by those in the others, for who stays
    there stays here.

    Args:
        sequence: Its templates.
        camera_index: Whose foreground.
        reader: Of the pictures.
        parameters: Of the foreground model.
    """
    camera = sequence.views[camera_index].camera.name
    trust: dict[str, float] = {}
    for name in dict.fromkeys(template.name for template in sequence.templates):
        own = [template for template in sequence.templates if template.name == name]
        here = [template for template in own if template.camera == camera]
        shares = [
            share
            for template in here or own
            if (share := _share(sequence, template, reader, parameters)) is not None
        ]
        if not shares:
            trust[name] = 1.0
            continue
        u = float(np.clip((np.mean(shares) - NOTHING) / (ENOUGH - NOTHING), 0.0, 1.0))
        trust[name] = u * u * (3.0 - 2.0 * u)
    return trust


def taught_well(sequence: Sequence) -> bool:
    """Whether every person has a template in every camera, and several in one.

    What somebody's colours are in another camera, by another light, is guessed from those in
    one, and from the other side from those of one side.
    """
    taught = Counter((template.name, template.camera) for template in sequence.templates)
    names = {template.name for template in sequence.templates}
    cameras = [camera.name for camera in sequence.cameras]
    counts = [[taught[name, camera] for camera in cameras] for name in names]
    return all(min(count) > 0 and max(count) > 1 for count in counts)


@dataclass(frozen=True, slots=True)
class ShapesOfTemplates:
    """What people by shape are at the templates, which are proof of a person."""

    trust: dict[str, float]
    """Of each person with templates, the probability by shape at the likeliest of them."""
    fit: float
    """Mean intersection over union of a template and the person by shape there, 0 … 1."""


def shapes_of_templates(sequence: Sequence, reader: Pictures) -> ShapesOfTemplates:
    """How far shapes are to be believed: whether they see who is there, and where he is.

    Who lies, or whose template nobody would take for a person, is not seen by shape. A target
    that is no head or body, or a floor that is not where the room begins, puts them elsewhere.

    Args:
        sequence: Its templates, as stage 1 sees its pictures.
        reader: Of the pictures.
    """
    trust: dict[str, float] = {}
    fits = []
    for name in dict.fromkeys(template.name for template in sequence.templates):
        own = [template for template in sequence.templates if template.name == name]
        for template in own[:TEMPLATES_BY_SHAPE]:
            likelihood, fit = _by_shape(sequence, template, reader)
            trust[name] = max(trust.get(name, 0.0), likelihood)
            fits.append(fit)
    return ShapesOfTemplates(trust, float(np.mean(fits)) if fits else 0.0)


def _by_shape(sequence: Sequence, template: Template, reader: Pictures) -> tuple[float, float]:
    """The probability of a person by shape in a template's box, and how much of it they share;
    0 where nothing can be said."""
    names = [view.camera.name for view in sequence.views]
    if template.camera not in names:
        return 0.0, 0.0
    camera = names.index(template.camera)
    what = (template.camera, template.frame, template.box.tobytes(), geometry(sequence, camera))

    def look() -> tuple[float, float]:
        finder = ShapeFinder.of(sequence, camera, reader)
        state = finder.start()
        # the pictures before show what moves
        before = min(template.frame, PICTURES_BEFORE)
        pictures = reader.iterate(camera, template.frame - before)
        for picture in islice(pictures, before):
            reader.check()
            if picture is not None:
                state = finder.watch(state, picture)
        picture = template_picture(reader, camera, template.frame)
        if picture is None:
            return 0.0, 0.0
        _, found = finder.find(state, picture, PASSED, OVERLAP)
        there = Boxes(found.boxes).left_top
        shared = box_overlaps(there, template.box[None]).max(initial=0.0)
        support = found.support(Boxes.from_left_top(template.box[None]).centred)
        return float(expit(support[0])), float(shared)

    return reader.once(("template by shape", what), look)


def _share(
    sequence: Sequence, template: Template, reader: Pictures, parameters: ForegroundParams
) -> float | None:
    """The share of foreground in a template's box; None where nothing can be said."""
    names = [view.camera.name for view in sequence.views]
    if template.camera not in names:
        return None
    camera = names.index(template.camera)
    what = (template.camera, template.frame, template.box.tobytes())

    def look() -> float | None:
        picture = template_picture(reader, camera, template.frame)
        model = learn(sequence, camera, reader, parameters)
        if picture is None or model is None:
            return None
        _, found = model.step(model.start(), picture)
        edges: Float[ndarray, "1 4"] = Boxes.from_left_top(template.box[None]).corners
        return float(box_shares(integral(found.mask), edges)[0])

    return reader.once(("template on foreground", parameters, what), look)
