"""Small files that a person would miss, written atomically: to a temporary file, then renamed."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any


def write_json(path: Path, value: Any) -> None:
    """Write a value wholly or not at all, whatever interrupts it.

    Raises:
        OSError: If the place cannot be written to; what was there still is.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, begun = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            json.dump(value, file, indent=2, ensure_ascii=False)
        os.replace(begun, path)
    except BaseException:
        Path(begun).unlink(missing_ok=True)
        raise
