"""Boxes that people drew, as annotation programs write them."""
