"""What each parameter is about: the groups of the panel, whatever stage or method it is of."""

from __future__ import annotations

from typing import Literal, get_args

from tracker.parameters import Parameter

Topic = Literal["Motion", "Birth", "Detection", "Clutter", "Foreground", "Extraction"]

TOPICS: tuple[Topic, ...] = get_args(Topic)
"""In the order of a filter's step."""

_WORDS: dict[Topic, tuple[str, ...]] = {
    "Foreground": ("foreground", "background", "shadow", "exposure", "blinding"),
    "Motion": (
        "survival", "motion", "acceleration", "velocity", "vertical_share", "growth_sigma",
        "memory", "recognition", "followed", "vanish", "return", "leap", "longest_hidden",
        "patience", "matrix.reach", "straying", "histogram_rate", "follow_mild", "mild_share",
        "size_rate", "occlusion_distance", "interrupted",
    ),
    "Birth": ("birth", "newcomer", "confirmation", "spread_starts", "start_", "room_tolerance"),
    "Clutter": (
        "clutter", "gate_volume", "separation", "duplicate", "merge_distance",
        "same_person_distance", "smallest_cluster", "score_threshold", "least_probability",
    ),
    "Extraction": (
        "extraction", "output", "pruning", "merging", "max_components", "room_margin",
        "redistribution", "resampling", "targets_per_person", "smoothing",
    ),
}  # fmt: skip
"""Parts of a parameter's key, the more special ones first: what has none of them is about how a
person shows in a picture."""


def topic_of(parameter: Parameter) -> Topic:
    """What a parameter is about: by its group where all of that is about one thing, else by name.

    So a method that another package brings has its place, too.
    """
    if parameter.group == "foreground":
        return "Foreground"
    for topic, words in _WORDS.items():
        if any(word in parameter.key for word in words):
            return topic
    return "Extraction" if parameter.stage == "tracks" else "Detection"
