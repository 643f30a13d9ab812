"""Sentences about cameras whose boxes are out of line with the others', and about their clocks."""

from __future__ import annotations

import numpy as np

from tracker.io.checks.synchronisation import LEAST_STEPS, common_offset
from tracker.io.checks.timing import uneven_clocks
from tracker.runs.run import Run
from tracker.smoothing.camera_errors import CameraErrors, Quantity, significant_deviations

_WALKING = 1.4
"""Preferred speed of walking, m/s (Bohannon, Age and Ageing 26(1), 1997)."""

_ERRING: dict[Quantity, str] = {
    "horizontal": "their places across the picture err",
    "vertical": "their places up and down the picture err",
    "height": "their heights err",
    "all": "they err",
}


def camera_notes(run: Run) -> list[str]:
    """Describe which camera's boxes err more than those of the others, and which cameras are late.

    A delay is named where it is significant, as long as the check reports it, and somebody who
    walks moves by more in this time than the boxes of a camera are off. A camera that lost frames
    is named in the check's words.
    """
    smoothed = run.smoothed
    if smoothed is None or smoothed.cameras is None or smoothed.noise is None:
        return []
    names = [view.camera.name for view in run.sequence.views]
    found = out_of_line_notes(run)
    off = float(smoothed.noise.persistent[0] * run.sequence.target_half_extents[2])
    delays = _delays(smoothed.cameras, names, off / _WALKING, run.sequence.fps)
    uneven = uneven_clocks(run.sequence)
    found += uneven
    if delays and not uneven:  # where a clock jumps, a mean delay says nothing
        found.append(
            f"by the boxes, {'; '.join(delays)}; nothing is corrected: multiview-phd check "
            "measures this by itself and says whether frames are missing, or what to write as "
            "time_offset in sequence.toml"
        )
    return found


def out_of_line_notes(run: Run) -> list[str]:
    """Describe which camera's boxes err more than those of the others; empty for none."""
    errors = None if run.smoothed is None else run.smoothed.cameras
    if errors is None or errors.out_of_line is None:
        return []
    camera, quantity = errors.out_of_line
    factor = errors.of(camera, quantity)
    return [
        f'the boxes of camera "{run.sequence.views[camera].camera.name}" are out of line: '
        f"{_ERRING[quantity]} {factor:.1f} times as much as the other cameras'; its calibration is "
        "turned, or its boxes are worse, see multiview-phd check; sigma is too small where it "
        "alone sees somebody"
    ]


def _delays(errors: CameraErrors, names: list[str], least: float, fps: float) -> list[str]:
    """Describe the delays of more than ``least`` seconds that are significant.

    As in the check, they are relative to the clock that most cameras share, and those of fewer than
    :data:`~tracker.io.checks.synchronisation.LEAST_STEPS` are none: a step shows the frame that is
    nearest in time.
    """
    steps = errors.delays * fps
    steps = steps - common_offset(steps)
    bound = np.maximum(least, significant_deviations(len(names)) * errors.delay_sigmas)
    late = (np.abs(errors.delays) > bound) & (np.abs(steps) >= LEAST_STEPS)
    return [
        f'camera "{names[camera]}" is {abs(steps[camera]) / fps:.2f} s '
        f"({abs(steps[camera]):.1f} steps) {'late' if steps[camera] > 0.0 else 'early'}"
        for camera in np.flatnonzero(late).tolist()
    ]
