"""Stage 2: the boxes of all cameras into one 3D posterior. One protocol, one file a method.

The methods are registered in :mod:`tracker.parameters.registry`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from tracker.fusion.protocol import FusionMethod, FusionResult

if TYPE_CHECKING:
    from tracker.parameters import RunParameters
    from tracker.sequences.sequence import Sequence

__all__ = ["FusionMethod", "FusionResult", "create"]


def create(sequence: Sequence, parameters: RunParameters) -> FusionMethod:
    """The fusion method that the parameters name, prepared for a sequence.

    Raises:
        ValueError: If the sequence lacks what it needs.
    """
    method: FusionMethod = parameters.method("fusion_method").load()(sequence, parameters)
    return method
