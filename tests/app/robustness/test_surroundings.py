"""A system as it should not be: no home folder, one that cannot be written to, a clock that goes
back."""

from __future__ import annotations

import itertools
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from tests.app.folders import write_crossing
from tests.library.runs import RECORDING, run
from tests.studies.small import Serial, definition, made_up
from tests.studies.small import run as run_study
from tracker.files import folders
from tracker.kernels.compilation import kernel_folder
from tracker.library.store import Library
from tracker.studies.store import create

PROGRAM = """
import os, sys
if sys.argv[1] == "nowhere":
    import pwd
    del os.environ["HOME"]
    def unknown(user):
        raise KeyError(user)
    pwd.getpwuid = unknown
from app.command.main import main
sys.exit(main(sys.argv[2:]))
"""


def said(home: Path | None, temporary: Path, *words: str) -> tuple[int, str]:
    """What a command says whose home is at a place, or that has none."""
    dropped = ("XDG_", "MULTIVIEW_PHD_")
    environment = {k: v for k, v in os.environ.items() if not k.startswith(dropped)}
    environment |= {
        "HOME": str(home), "TMPDIR": str(temporary), "NUMBA_CACHE_DIR": str(kernel_folder()),
    }  # fmt: skip
    mode = "nowhere" if home is None else "there"
    line = [sys.executable, "-c", PROGRAM, mode, *words]
    done = subprocess.run(
        line, env=environment, capture_output=True, text=True, timeout=300.0, check=False
    )
    return done.returncode, done.stdout + done.stderr


@pytest.fixture
def no_folder(tmp_path: Path) -> Path:
    """A home that nobody, not even the system's administrator, can write to."""
    (tmp_path / "file").write_text("no folder")
    return tmp_path / "file" / "home"


@pytest.mark.full
@pytest.mark.parametrize("is_there", [False, True], ids=["no home", "not to be written to"])
def test_recordings_are_tracked_without_a_home(
    tmp_path: Path, no_folder: Path, is_there: bool
) -> None:
    folder, home = write_crossing(tmp_path / "crossing", frames=20), no_folder if is_there else None
    output = tmp_path / "tracks.csv"
    status, words = said(home, tmp_path, "track", str(folder), "-o", str(output))
    assert status == 0, words
    assert "unexpected" not in words
    assert output.read_text().count("\n") > 20
    assert ("was not kept" in words) == is_there
    status, words = said(home, tmp_path, "runs")
    assert (status == 0) == (not is_there), words
    assert "unexpected" not in words
    status, words = said(home, tmp_path, "study", "show")
    assert status == 1
    assert "expected a study" in words
    if not is_there:  # what it kept instead nobody else can open
        (own,) = tmp_path.glob(f"multiview-phd-{os.getuid()}")
        assert own.stat().st_mode & 0o77 == 0
        assert (own / "multiview-phd" / "library.sqlite3").is_file()


def test_a_folder_that_somebody_else_made_is_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    folders._instead.cache_clear()
    own = folders._instead()
    assert own == tmp_path / f"multiview-phd-{os.getuid()}"
    own.rmdir()
    (tmp_path / "elsewhere").mkdir()
    own.symlink_to(tmp_path / "elsewhere")
    folders._instead.cache_clear()
    other = folders._instead()
    assert other != own
    assert other.stat().st_mode & 0o77 == 0
    own.unlink()
    own.mkdir(mode=0o777)
    own.chmod(0o777)
    folders._instead.cache_clear()
    assert folders._instead() not in (own, other)
    folders._instead.cache_clear()


@pytest.fixture
def backwards(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each look at the clock is an hour earlier than the one before."""
    begin, hours = time.time(), itertools.count(1)
    monkeypatch.setattr(time, "time", lambda: begin - 3600.0 * next(hours))


@pytest.mark.usefixtures("backwards")
def test_a_run_that_was_kept_stays_though_the_clock_went_back(tmp_path: Path) -> None:
    with Library(tmp_path / "library.sqlite3") as library:
        kept = [
            library.keep(RECORDING, run(number, began=1000.0 - number), budget=3)
            for number in range(6)
        ]
        assert [one.id for one in library.runs() if one.id == kept[-1]] == [kept[-1]]
        assert len(library.runs()) == 3
        library.delete([kept[-1]])
        library.restore([kept[-1]])
        assert library.result(kept[-1]).run.id == kept[-1]


@pytest.mark.full
@pytest.mark.usefixtures("backwards")
def test_a_study_tells_every_trial_though_the_clock_goes_back(tmp_path: Path) -> None:
    store = create(definition(tmp_path, trials=12, prune=False), tmp_path / "studies")
    assert run_study(store, Serial(made_up(lambda values: 0.5))).state == "done"
    trials = store.trials()
    assert len(trials) == 12
    heard, last = [], 0.0
    for one in sorted(trials, key=lambda trial: trial.ended):
        new = [each for each in store.trials(last) if each.ended <= one.ended]
        heard += [each.number for each in new]
        last = one.ended
    assert sorted(heard) == list(range(12))
    assert [one.number for one in sorted(trials, key=lambda one: one.ended)] == list(range(12))
    assert store.status().seconds >= 0.0
