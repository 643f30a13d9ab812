"""Tracking in one camera by joint probabilistic data association, with five cases.

:mod:`~tracker.single_view.jpda.method` combines the sources of measurements, the association
matrix, its cases, and their effect on the targets.
"""

from __future__ import annotations

from tracker.single_view.jpda.method import Jpda, JpdaState

__all__ = ["Jpda", "JpdaState"]
