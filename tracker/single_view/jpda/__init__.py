"""Tracking in one camera by joint probabilistic data association, with five cases.

:mod:`~tracker.single_view.jpda.method` puts together where the measurements come from,
the association matrix, the cases it tells apart, and what they do to the targets.
"""

from __future__ import annotations

from tracker.single_view.jpda.method import Jpda, JpdaState

__all__ = ["Jpda", "JpdaState"]
