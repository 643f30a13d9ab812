"""A run without tracks names the stage that lost all people."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from tests.runs.test_gates import film
from tests.synthetic import write_lines, write_sequence
from tracker.parameters.catalogue import RunParameters
from tracker.runs import pipeline
from tracker.runs.fitting import default_parameters
from tracker.runs.gates import notices
from tracker.runs.outcome import StageCounts, _losing_stage, why_no_tracks
from tracker.runs.run import Run
from tracker.sequences.reader import read_sequence

ALL = StageCounts(
    frames=100, found=1000, outside=500, passed=20, together=60, pairs=60, begun=3, surest=0.4,
    tracks=0,
)  # fmt: skip


@pytest.mark.parametrize(
    ("counts", "cameras", "words"),
    [
        ({"frames": 0}, 2, "not one of the frames of boxes could be read"),
        ({"found": 0}, 2, "lower what a box must have to count"),
        ({"passed": 19}, 2, "nearly none can stand in [room]"),
        ({"passed": 19, "outside": 499}, 2, "colour_phd itself holds them back"),
        ({"found": 20, "passed": 22}, 2, "20 boxes found, 22 passed on to the fusion"),
        ({"pairs": 59, "begun": 0}, 2, "0 tracks begun: these are too few boxes to tell why"),
        ({"pairs": 59}, 2, "3 tracks begun: these are too few boxes to tell why"),
        ({"together": 0}, 2, "a track begins where boxes of two cameras meet"),
        (
            {"together": 0, "begun": 0},
            1,
            "20 passed on to the fusion, 0 tracks begun: the ",
        ),
        ({"together": 0}, 1, "20 passed on to the fusion, 3 tracks begun, the surest"),
        ({"begun": 0}, 2, "boxes of different cameras meet nowhere"),
        ({}, 2, "3 tracks begun, the surest with existence 0.40, below the extraction"),
    ],
)
def test_the_first_stage_without_output_is_named(
    counts: dict[str, int], cameras: int, words: str, tmp_path: Path
) -> None:
    sequence = film(tmp_path, stays=False)
    views = sequence.views * cameras
    run = Run(replace(sequence, views=views), RunParameters(), 0, {})
    assert words in _losing_stage(run, replace(ALL, **counts))


def test_files_without_a_box_are_named_and_no_value_is_blamed(tmp_path: Path) -> None:
    folder = write_sequence(tmp_path / "empty", frames=4, container=None, detections=True)
    for view in read_sequence(folder).views:
        write_lines(folder / f"{view.camera.name}.csv", "frame,left,top,width,height,score", [])
    sequence = read_sequence(folder)
    run = pipeline.compute(sequence, default_parameters(sequence))
    assert why_no_tracks(run) == (
        "no tracks: the files of boxes hold no box of the steps 0 … 3; "
        "see detections and detections_first_frame in sequence.toml"
    )
    assert notices(run) == []
