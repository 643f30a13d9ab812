"""Settings that all tests share."""

from __future__ import annotations

from hypothesis import HealthCheck, settings

# the same examples every time; how long one takes says nothing of whether it is right
settings.register_profile(
    "repeatable",
    derandomize=True,
    database=None,
    deadline=None,
    max_examples=60,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.load_profile("repeatable")
