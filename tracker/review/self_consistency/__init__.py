"""Self-consistency: an estimate of identity accuracy without ground truth, by variants of a run.

A recording is tracked as it is, backwards in time, and once without each camera. Identities on
which all of these agree are not an accident of one run; where they differ one of them is wrong.
"""

from tracker.review.self_consistency.estimate import Estimate, estimate

__all__ = ["Estimate", "estimate"]
