"""Rooms drawn by a seed alone: cameras, lenses, light, people and what disturbs, with truth.

They are for finding out where a method fails, and why: every room says what is in it.
"""

from __future__ import annotations

from tests.rooms.random_rooms.choices import Choices, choose
from tests.rooms.random_rooms.film import LABELS_FILE, VERSION, render_chosen, render_random

__all__ = ["LABELS_FILE", "VERSION", "Choices", "choose", "render_chosen", "render_random"]
