"""Stage 1: what each camera sees by itself. One protocol, one file a method.

The methods are registered in :mod:`tracker.parameters.registry`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tracker.single_view.protocol import SingleViewMethod, ViewResult

if TYPE_CHECKING:
    from tracker.parameters import RunParameters
    from tracker.sequences.pictures.frames import Pictures
    from tracker.sequences.sequence import Sequence

__all__ = ["SingleViewMethod", "ViewResult", "create"]


def create(
    name: str,
    sequence: Sequence,
    camera_index: int,
    parameters: RunParameters,
    reader: Pictures,
) -> SingleViewMethod:
    """The single-view method of that name, prepared for one camera of a sequence.

    Raises:
        ValueError: If there is no such method, or the sequence lacks what it needs.
    """
    from tracker.parameters import method_of  # with those of other packages, which import this

    make = method_of("single_view", name).load()
    method: SingleViewMethod = make(sequence, camera_index, parameters, reader)
    return method
