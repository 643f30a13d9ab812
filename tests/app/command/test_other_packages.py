"""A method of another package: one file and an entry point, and it is everywhere."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[3]

SINGLE_VIEW = '''
"""Says that one person fills the middle of every picture."""

from typing import Annotated

import numpy as np
from pydantic import Field

from tracker.parameters import Method, Params, Reads, Uses, ui
from tracker.single_view import ViewResult


class MiddleParams(Params):
    """A person in the middle."""

    half_width: Annotated[float, Field(ge=1.0, le=200.0), ui("w", unit="px", step=1.0)] = 20.0
    """Half of the box's width."""


class Middle:
    def __init__(self, sequence, camera_index, parameters, reader):
        width, height = sequence.cameras[camera_index].image_size
        half = parameters.of(MiddleParams).half_width
        self._box = np.array([[width / 2.0, height / 2.0, half, 3.0 * half]])

    def start(self):
        return None

    def step(self, state, frame, picture, rng):
        return None, ViewResult.of_boxes(self._box, np.ones(1), 0.1 * self._box)


METHOD = Method(
    name="middle",
    help="A person in the middle.",
    made_by=Middle,
    uses=Uses(pictures=True, reads=(Reads("middle"),)),
    parameters=MiddleParams,
)
'''

FUSION = '''
"""The fusion of this project under another name, with a number of its own."""

from typing import Annotated

from pydantic import Field

from tracker.parameters import Method, Params, Reads, Uses, ui


class CalmParams(Params):
    """Calm people."""

    calm: Annotated[int, Field(ge=0, le=5), ui("c", step=1)] = 1
    """How calm they are."""


METHOD = Method(
    name="calm",
    help="Calm people.",
    made_by="tracker.fusion.multi_bernoulli:MultiBernoulli",
    uses=Uses(reads=(Reads("fusion", without=frozenset({"misses", "extraction"})), Reads("calm"))),
    parameters=CalmParams,
)
'''

BROKEN = {
    "absent": "nowhere_to_be_found:METHOD",
    "other": "middle_tracker:Middle",
    "again": "again_tracker:METHOD",
}
"""Entry points that name no method, and one whose method has a name that is taken."""

EVERYWHERE = """
import json, sys, tempfile
{first}
from app.web.results import schema
from tracker.runs import pipeline, warm_up
from tracker.parameters.catalogue import METHODS, RunParameters
from tracker.parameters.values import changed_values, shown_keys, stage_values, with_values
from tracker.runs.fitting import unfit_methods
from tracker.runs.run import stage_keys
from pathlib import Path

parameters = with_values(
    RunParameters(), {{"single_view": "middle", "fusion_method": "calm", "middle.half_width": "7"}}
)
with tempfile.TemporaryDirectory() as folder:
    recording = warm_up._recording(Path(folder))
    run = pipeline.compute(recording, parameters, steps=3)
    keys = stage_keys(recording, parameters, 0)
told = schema()
print(json.dumps({{
    "methods": METHODS,
    "shown": shown_keys(parameters),
    "read": list(stage_values(parameters, "single_view")),
    "changed": changed_values(parameters),
    "boxes": run.views[2][0].boxes.tolist(),
    "keys": keys,
    "page": [p.key for p in told.parameters if p.group in ("middle", "calm")],
    "choices": told.methods,
    "groups": [g.name for g in told.groups],
    "stages": {{p.key: p.stage for p in told.parameters if p.group in ("middle", "calm")}},
    "unfit": unfit_methods(recording, parameters)["single_view"],
    "json": RunParameters.model_validate_json(parameters.model_dump_json()) == parameters,
    "own": warm_up._own("single_view"),
}}))
"""


def installed(folder: Path, points: dict[str, dict[str, str]], version: str = "1.2") -> None:
    """A distribution as pip leaves it."""
    (folder / "middle_tracker.py").write_text(SINGLE_VIEW)
    (folder / "calm_fusion.py").write_text(FUSION)
    again = SINGLE_VIEW.replace('name="middle"', 'name="colour_phd"')
    (folder / "again_tracker.py").write_text(again)
    facts = folder / f"people_trackers-{version}.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: people-trackers\nVersion: {version}\n"
    )
    lines = []
    for group, entries in points.items():
        lines += [f"[multiview_phd.{group}]", *(f"{k} = {v}" for k, v in entries.items())]
    (facts / "entry_points.txt").write_text("\n".join(lines) + "\n")


POINTS = {
    "single_view": {"middle": "middle_tracker:METHOD"},
    "fusion": {"calm": "calm_fusion:METHOD"},
}


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Python with the distribution beside this project."""
    places = os.pathsep.join([str(folder), str(ROOT), os.environ.get("PYTHONPATH", "")])
    return subprocess.run(
        [sys.executable, *arguments],
        env={**os.environ, "PYTHONPATH": places, "COLUMNS": "200"},
        capture_output=True,
        text=True,
        timeout=120,
    )


def everywhere(folder: Path, first: str = "") -> dict[str, Any]:
    """What a program that tracks with the other package's methods has to say."""
    done = python(folder, "-W", "error", "-c", EVERYWHERE.format(first=first))
    assert done.returncode == 0, done.stderr
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


@pytest.mark.full
@pytest.mark.parametrize("first", ["", "import middle_tracker"])
def test_a_method_of_another_package_is_everywhere(tmp_path: Path, first: str) -> None:
    installed(tmp_path, POINTS)
    found = everywhere(tmp_path, first)
    assert found["methods"] == found["choices"]
    assert found["methods"]["single_view"][-1] == "middle"
    assert found["methods"]["fusion_method"][-1] == "calm"
    assert found["read"] == ["single_view", "middle.half_width"]
    assert found["changed"] == {
        "single_view": "middle",
        "fusion_method": "calm",
        "middle.half_width": 7.0,
    }
    assert found["boxes"] == [[80.0, 60.0, 7.0, 21.0]]
    assert found["page"] == ["middle.half_width", "calm.calm"]
    assert found["stages"] == {"middle.half_width": "single_view", "calm.calm": "fusion"}
    assert {"middle", "calm"} <= set(found["groups"])
    shown = set(found["shown"])
    assert {"middle.half_width", "calm.calm", "fusion.recognition"} <= shown
    assert not shown & {"fusion.misses", "colour_phd.samples", "foreground.model"}
    assert set(found["unfit"]) == {"onnx_detector"}, "which has no network"
    assert found["json"]
    assert "middle" not in found["own"], "the warm-up is of this project's kernels"


@pytest.mark.full
def test_another_version_of_the_package_makes_other_results(tmp_path: Path) -> None:
    keys = []
    for number, change in (("1.2", ""), ("1.3", ""), ("1.3", "# changed\n")):
        folder = tmp_path / str(len(keys))
        folder.mkdir()
        installed(folder, POINTS, number)
        with (folder / "middle_tracker.py").open("a") as source:
            source.write(change)
        keys.append(everywhere(folder)["keys"])
    assert len({one["single_view"] for one in keys}) == 3


@pytest.mark.full
def test_its_parameters_have_flags_and_are_listed(tmp_path: Path) -> None:
    installed(tmp_path, POINTS)
    listed = python(tmp_path, "-m", "app", "parameters", "--json")
    assert listed.returncode == 0, listed.stderr
    row = next(row for row in json.loads(listed.stdout) if row["key"] == "middle.half_width")
    assert {"w", "1 … 200", "px", "20", "Half of the box's width."} <= set(row.values())
    helped = python(tmp_path, "-m", "app", "track", "--help")
    assert helped.returncode == 0, helped.stderr
    assert "--middle.half-width" in helped.stdout
    assert "|middle" in helped.stdout
    assert "|calm" in helped.stdout


@pytest.mark.full
def test_what_cannot_be_used_is_told_and_left_out(tmp_path: Path) -> None:
    installed(tmp_path, {"single_view": {**POINTS["single_view"], **BROKEN}})
    done = python(
        tmp_path,
        "-c",
        "from tracker.parameters.catalogue import METHODS; print(*METHODS['single_view'])",
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.split()[-1] == "middle"
    assert len(done.stdout.split()) == 9
    said = " ".join(done.stderr.split())
    where = "in multiview_phd.single_view of people-trackers 1.2"
    for words in (
        f'entry point absent = "nowhere_to_be_found:METHOD" {where}: cannot be imported: '
        "ModuleNotFoundError: No module named 'nowhere_to_be_found'. The method is left out.",
        f'"middle_tracker:Middle" {where}: expected a tracker.parameters.Method, found type.',
        f'"again_tracker:METHOD" {where}: there is a method "colour_phd" already; '
        "give it another name.",
    ):
        assert words in said
