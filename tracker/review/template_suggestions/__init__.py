"""Templates that a run offers: boxes of people whom several cameras agree about.

Nothing here changes a run: a person looks at what is offered, and takes it or leaves it.
"""

from tracker.review.template_suggestions.offered import Offer, offered, untaken

__all__ = ["Offer", "offered", "untaken"]
