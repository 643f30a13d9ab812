"""The sequence's templates: boxes whose colour histograms model the people."""

from __future__ import annotations

import numpy as np

from tracker.geometry.boxes import Boxes
from tracker.sequences.errors import SequenceError
from tracker.sequences.pictures.frames import Picture, Pictures
from tracker.sequences.sequence import Sequence
from tracker.single_view.pictures import colour
from tracker.single_view.pictures.colour import ColourModel, ColourSpaceName, KernelName


def read_templates(
    sequence: Sequence, space: ColourSpaceName, kernel: KernelName, reader: Pictures
) -> ColourModel:
    """Read the colour model of the sequence's templates, once for all cameras.

    Args:
        sequence: The sequence; templates of one name are of one person.
        space: The bins of the histograms.
        kernel: The weights of the pixels of a box.
        reader: Reader of the images.

    Raises:
        ValueError: If there is no template, or the image or box of one cannot be used.
    """
    if not sequence.templates:
        raise ValueError(
            f"{sequence.name} has no template of a person's colours; add at least one [[template]] "
            "with camera, frame and box to sequence.toml"
        )
    what = [(t.name, t.camera, t.frame, t.box.tobytes()) for t in sequence.templates]
    return reader.once(
        ("templates", space, kernel, *what), lambda: _read(sequence, space, kernel, reader)
    )


def template_picture(reader: Pictures, camera: int, step: int) -> Picture | None:
    """Read the image of a template, once: in a video it is far from the frames read otherwise.

    Args:
        reader: Reader of the images.
        camera: Index of the camera.
        step: Step of the template.
    """
    return reader.once(("template picture", camera, step), lambda: reader.picture(camera, step))


def _read(
    sequence: Sequence, space: ColourSpaceName, kernel: KernelName, reader: Pictures
) -> ColourModel:
    """Read the histograms of all templates, or raise an error that names the template."""
    names = [camera.name for camera in sequence.cameras]
    histograms = []
    for template in sequence.templates:
        place = (
            f'{sequence.folder.name}/sequence.toml, template "{template.name}" '
            f"({template.camera}, frame {template.frame})"
        )
        if template.camera not in names:
            raise SequenceError(f"{place}: there is no such camera; expected {', '.join(names)}")
        picture = template_picture(reader, names.index(template.camera), template.frame)
        if picture is None:
            raise SequenceError(f"{place}: its picture cannot be read; choose another frame")
        box = Boxes.from_left_top(template.box[None]).centred
        histogram = colour.histograms(colour.bin_map(picture, space), box, space, kernel)[0]
        if not histogram.any():
            raise SequenceError(
                f"{place}: the box {template.box.tolist()} lies outside the picture of "
                f"{picture.shape[1]}x{picture.shape[0]}; move it inside"
            )
        histograms.append(histogram)
    return ColourModel.of(
        np.array(histograms),
        [template.name for template in sequence.templates],
        space,
        kernel,
    )
