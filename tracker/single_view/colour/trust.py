"""How far the foreground is to be believed about each person, by their templates.

Somebody who never leaves is learnt as background. A template is proof that a person
was there: where it lies on background, the foreground is wrong and not the template.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from tracker.boxes import Boxes
from tracker.foreground import box_shares, integral, learn
from tracker.parameters import ForegroundParams
from tracker.sequences.pictures.frames import Pictures
from tracker.sequences.sequence import Sequence, Template

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
        picture = reader.picture(camera, template.frame)
        model = learn(sequence, camera, reader, parameters)
        if picture is None or model is None:
            return None
        _, found = model.step(model.start(), picture)
        edges: Float[ndarray, "1 4"] = Boxes.from_left_top(template.box[None]).corners
        return float(box_shares(integral(found.mask), edges)[0])

    return reader.once(("template on foreground", parameters, what), look)
