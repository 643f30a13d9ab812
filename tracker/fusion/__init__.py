"""Stage 2: the boxes of all cameras into one 3D posterior. One protocol, one file a method."""

from tracker.fusion.multi_bernoulli import MultiBernoulli
from tracker.fusion.protocol import FusionMethod, FusionResult
from tracker.fusion.sequential_phd import SequentialPhd
from tracker.parameters import RunParameters
from tracker.sequences.sequence import Sequence

__all__ = ["FusionMethod", "FusionResult", "create"]


def create(sequence: Sequence, parameters: RunParameters) -> FusionMethod:
    """The fusion method that the parameters name, prepared for a sequence."""
    if parameters.fusion_method == "multi_bernoulli":
        return MultiBernoulli(sequence, parameters.fusion)
    return SequentialPhd(sequence, parameters.fusion)
