"""Stage 2: the boxes of all cameras become one 3D posterior. One protocol, one file a method.

The methods are described in :mod:`tracker.parameters.groups` and chosen in :func:`maker`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from tracker.fusion.protocol import FusionMethod, FusionResult

if TYPE_CHECKING:
    from tracker.parameters import Method
    from tracker.parameters.catalogue import RunParameters
    from tracker.sequences.sequence import Sequence

__all__ = ["FusionMethod", "FusionResult", "create", "maker"]


def maker(method: Method) -> Callable[[Sequence, RunParameters], FusionMethod]:
    """The class of a method of stage 2, which is imported only when it is chosen."""
    match method.name:
        case "sequential_phd":
            from tracker.fusion.sequential_phd import SequentialPhd

            return SequentialPhd
        case "multi_bernoulli":
            from tracker.fusion.multi_bernoulli import MultiBernoulli

            return MultiBernoulli
    return method.load()


def create(sequence: Sequence, parameters: RunParameters) -> FusionMethod:
    """Create the fusion method that the parameters name for a sequence.

    Raises:
        ValueError: If the sequence lacks data that the method needs.
    """
    return maker(parameters.method("fusion_method"))(sequence, parameters)
