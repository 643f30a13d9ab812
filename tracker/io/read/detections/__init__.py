"""Boxes of people as detectors and annotation programs write them."""
