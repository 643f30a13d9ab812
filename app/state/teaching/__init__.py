"""Teaching the open sequence: boxes of colours, the room's faces, entrances; and saving them."""

from __future__ import annotations

from app.state.teaching.teaching import Part, Side, Teaching

__all__ = ["Part", "Side", "Teaching"]
