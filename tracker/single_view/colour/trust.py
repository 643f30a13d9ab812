"""Trust in foreground and shape at each person, estimated at their templates.

A person who never leaves is learnt as background. A template is proof of a person:
where it lies on background, the foreground is wrong and not the template.
The same holds for shapes: a person who lies, or whose template does not look like a person, is
not detected by shape.
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
from tracker.parameters.groups.detections import ShapesParams
from tracker.parameters.groups.foreground import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence, Template
from tracker.single_view.box_sizes import geometry_key
from tracker.single_view.colour.templates import template_picture
from tracker.single_view.pictures.foreground import box_shares, integral, learn
from tracker.single_view.shape.finder import ShapeFinder

PICTURES_BEFORE = 8
"""Number of images before a template's that are used for the detection of motion."""

TEMPLATES_BY_SHAPE = 2
"""Number of templates of each person that are used: each takes a moment before the first step."""

_SHAPES = ShapesParams()
"""The default parameters of people by shape: the method ``shapes`` alone reads those of a run."""

NOTHING, ENOUGH = 0.1, 0.3
"""Shares of foreground in a template's box: below the first the foreground does not show the
person, from the second on it is trusted. Boxes drawn by hand around people in the foreground have
0.38 to 0.86."""


def template_trust(
    sequence: Sequence, camera_index: int, reader: Pictures, parameters: ForegroundParams
) -> dict[str, float]:
    """Estimate the trust in a camera's foreground at each person with templates, 0 … 1.

    It rises smoothly from 0 to 1 with the mean share f of foreground in the person's
    templates,

        t = 3 u² - 2 u³,  u = (f - f_0) / (f_1 - f_0) within 0 … 1.

    A person without a template in this camera is judged by those in the others, for a person who
    does not move there does not move here.

    Args:
        sequence: The sequence with its templates.
        camera_index: Index of the camera of the foreground.
        reader: Reader of the images.
        parameters: Parameters of the foreground model.
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


def templates_suffice(sequence: Sequence) -> bool:
    """Whether every person has a template in every camera, and several in one.

    A person's colours in another camera, with other light, are predicted from those in
    one, and those of the other side from those of one side.
    """
    taught = Counter((template.name, template.camera) for template in sequence.templates)
    names = {template.name for template in sequence.templates}
    cameras = [camera.name for camera in sequence.cameras]
    counts = [[taught[name, camera] for camera in cameras] for name in names]
    return all(min(count) > 0 and max(count) > 1 for count in counts)


@dataclass(frozen=True, slots=True)
class ShapesOfTemplates:
    """Agreement of people by shape with the templates, which are proof of a person."""

    trust: dict[str, float]
    """Probability by shape at the likeliest template of each person, by name, 0 … 1."""
    fit: float
    """Mean intersection over union of a template and the person by shape there, 0 … 1."""


def shapes_of_templates(sequence: Sequence, reader: Pictures) -> ShapesOfTemplates:
    """Estimate the trust in shapes: whether they detect the people of templates, and where.

    A person who lies, or whose template does not look like a person, is not detected. A target
    that is no head or body, or a floor that is not that of the room, shifts the detections.

    Args:
        sequence: The sequence with its templates, as stage 1 gets its images.
        reader: Reader of the images.
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
    """The probability of a person by shape in a template's box, and their overlap; 0 where the
    image cannot be used."""
    names = [view.camera.name for view in sequence.views]
    if template.camera not in names:
        return 0.0, 0.0
    camera = names.index(template.camera)
    what = (template.camera, template.frame, template.box.tobytes(), geometry_key(sequence, camera))

    def measure() -> tuple[float, float]:
        finder = ShapeFinder.of(sequence, camera, reader)
        state = finder.start()
        # the images before are needed for motion
        before = min(template.frame, PICTURES_BEFORE)
        pictures = reader.iterate(camera, template.frame - before)
        for picture in islice(pictures, before):
            reader.check()
            if picture is not None:
                state = finder.watch(state, picture)
        picture = template_picture(reader, camera, template.frame)
        if picture is None:
            return 0.0, 0.0
        _, found = finder.find(state, picture, _SHAPES.passed_odds, _SHAPES.overlap)
        there = Boxes(found.boxes).left_top
        shared = box_overlaps(there, template.box[None]).max(initial=0.0)
        support = found.support(Boxes.from_left_top(template.box[None]).centred)
        return float(expit(support[0])), float(shared)

    return reader.once(("template by shape", what), measure)


def _share(
    sequence: Sequence, template: Template, reader: Pictures, parameters: ForegroundParams
) -> float | None:
    """The share of foreground in a template's box; None where the image cannot be used."""
    names = [view.camera.name for view in sequence.views]
    if template.camera not in names:
        return None
    camera = names.index(template.camera)
    what = (template.camera, template.frame, template.box.tobytes())

    def measure() -> float | None:
        picture = template_picture(reader, camera, template.frame)
        model = learn(sequence, camera, reader, parameters)
        if picture is None or model is None:
            return None
        _, found = model.step(model.start(), picture)
        edges: Float[ndarray, "1 4"] = Boxes.from_left_top(template.box[None]).corners
        return float(box_shares(integral(found.mask), edges)[0])

    return reader.once(("template on foreground", parameters, what), measure)
