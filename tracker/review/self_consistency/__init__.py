"""How well people are told apart where nobody knows the truth: do other ways to look agree?

A recording is tracked as it is, backwards in time, and once without each camera. What all of
these hold alike was not an accident of one of them; where they differ one of them is wrong.
"""

from tracker.review.self_consistency.estimate import Estimate, estimate

__all__ = ["Estimate", "estimate"]
