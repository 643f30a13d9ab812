"""The export format TRC, for OpenSim and Mokka: a marker at the centre of each track, in metres.

Source: OpenSim documentation, "Marker (.trc) Files". After five lines of header a row has frame,
time, and X, Y, Z of each marker, separated by tabs; the cells of a missing marker are empty. World
x, y, z (z up) become X = x, Y = z, Z = −y (y up).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tracker.export.exported_run import ExportedRun, Options

Y_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
"""The rotation from world axes (z up) to those of the file (y up)."""


def write(path: Path, run: ExportedRun, options: Options) -> None:
    """Write a run as markers, step by step."""
    sequence, tracks, ids = run.sequence, run.tracks, run.ids
    place = {number: k for k, number in enumerate(ids)}
    fps, steps = f"{sequence.fps:g}", run.steps
    facts = {
        "DataRate": fps, "CameraRate": fps, "NumFrames": steps, "NumMarkers": len(ids),
        "Units": "m", "OrigDataRate": fps, "OrigDataStartFrame": 1, "OrigNumFrames": steps,
    }  # fmt: skip
    with path.open("w", encoding="ascii", errors="replace", newline="\n") as file:
        file.write(f"PathFileType\t4\t(X/Y/Z)\t{options.name}\n")
        file.write("\t".join(facts) + "\n" + "\t".join(map(str, facts.values())) + "\n")
        file.write("Frame#\tTime\t" + "".join(f"person{number}\t\t\t" for number in ids) + "\n")
        axes = (f"{axis}{k + 1}" for k in range(len(ids)) for axis in "XYZ")
        file.write("\t\t" + "\t".join(axes) + "\n\n")
        for step in range(steps):
            options.at(step, steps)
            cells = [""] * (3 * len(ids))
            rows = tracks.at(step)
            turned = tracks.positions[rows] @ Y_UP.T
            for number, (x, y, z) in zip(tracks.ids[rows].tolist(), turned.tolist(), strict=True):
                first = 3 * place[number]
                cells[first : first + 3] = [f"{x:.6f}", f"{y:.6f}", f"{z:.6f}"]
            file.write(f"{step + 1}\t{step * sequence.step_time:.6f}\t" + "\t".join(cells) + "\n")
    options.at(steps, steps)
