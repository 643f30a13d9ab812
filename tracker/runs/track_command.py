"""The command that computes a run again in a terminal."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

_METHODS = {"single_view": "--single-view", "fusion_method": "--fusion",
            "smoothing_method": "--smoothing"}  # fmt: skip


def track_command(
    recording: str, output: str, changes: Mapping[str, Any], seed: int, *options: str
) -> str:
    """Return the ``track`` command of a run, quoted for a POSIX shell.

    Args:
        recording: The name of a built-in room, or a folder.
        output: The file to write.
        changes: The methods and values to set, by key.
        seed: The seed of the run's random numbers.
        options: Further words of the command.
    """
    words = ["multiview-phd", "track", recording, "-o", output, *options]
    for key, value in changes.items():
        text = str(value).lower() if isinstance(value, bool) else str(value)
        words += [_METHODS[key], text] if key in _METHODS else ["--set", f"{key}={text}"]
    return shlex.join([*words, *(["--seed", str(seed)] if seed else [])])
