"""Kill commands, fill their disk, take away the right to write, and see what is left.

``python3 -m tests.bad_input.faults FILE --trials 900`` notes every trial as a line of ``FILE`` and
goes on where the file ends. A trial copies a small home with a recording, a kept run, a study and
corrections, runs one command of a person with one fault, and demands that

* nothing that was there is lost or altered but what the command writes,
* what it writes is as it was before or whole, never in between,
* no temporary file is left, unless the program was killed,
* a program that could not write says so in a sentence and ends with another status than 0,
* the same command succeeds afterwards, with the result that it has without a fault.

Disks are made by mounting one in memory, for which one must be root on Linux; elsewhere the
commands are killed only.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import os
import re
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from random import Random

import httpx2
import psutil

from tests.app.folders import write_crossing
from tests.browser.serving import Server, folders_in
from tests.io.read.recorded import detections, toml
from tests.studies.small import definition
from tracker.corrections.kinds import make
from tracker.corrections.log import read_log, write_log
from tracker.kernels.compilation import kernel_folder
from tracker.library import repair
from tracker.library.store import Library
from tracker.studies.store import Store, stores

STEPS = 40
FORMS = ("csv", "json", "trc", "glb", "html", "parquet", "zip")
FAULTS = ("kill", "full disk", "read only")
DISK_MB = 64
LONGEST_SECONDS = 120.0
STUDY = "small"
_OF_SEMAPHORES = re.compile(
    r"Traceback[^\n]*\n  File [^\n]*resource_tracker\.py[^\n]*\n[^\n]*\nKeyError[^\n]*"
)
_DATED = re.compile(rb"\d{4}-\d\d-\d\dT[\d:.]+(Z|[+-][\d:]+)")


class Fell(AssertionError):
    """What must not be, in words."""


@dataclass(frozen=True, slots=True)
class Job:
    """A command of a person, run in a copy of the home."""

    name: str
    arguments: tuple[str, ...]
    writes: str
    """What it writes, below the home; a folder if it has several files."""


def jobs() -> list[Job]:
    """Return the commands that are tried: runs, exports, studies, corrections, imports."""
    merge = ("corrections", "merge", "recording/corrections.toml", "more.toml", "-o")
    exports = [
        Job(
            f"export as {form}",
            ("bundle", "1", "-o", "out/run.zip")
            if form == "zip"
            else ("runs", "export", "1", "-o", f"out/run.{form}"),
            f"out/run.{form}",
        )
        for form in FORMS
    ]
    return [
        Job("run", ("track", "recording", "-o", "out/tracks.csv", "--seed", "3"), "out/tracks.csv"),
        Job("study", ("study", "run", "study.toml", "--workers", "1"), "home/studies"),
        Job("corrections", (*merge, "recording/corrections.toml"), "recording/corrections.toml"),
        Job("import", ("import", "source", "-o", "out/imported", "--fps", "10"), "out/imported"),
        *exports,
    ]


SERVED = Job("served corrections", (), "recording/corrections.toml")
"""Corrections made in the workbench, one after the other."""


def environment(home: Path) -> dict[str, str]:
    """Return the environment of a person whose files are all in one folder."""
    return {
        **os.environ,
        **folders_in(home / "home"),
        "NUMBA_CACHE_DIR": str(kernel_folder()),
        "TMPDIR": str(home / "tmp"),
    }


def start(home: Path, job: Job, said: Path) -> subprocess.Popen[bytes]:
    """Start a command in a session of its own; what it says goes into a file elsewhere."""
    with said.open("wb") as file:
        return subprocess.Popen(
            [sys.executable, "-m", "app", *job.arguments],
            cwd=home,
            env=environment(home),
            stdout=file,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )


def run(home: Path, job: Job, said: Path) -> int:
    """Run a command to its end and return its status."""
    process = start(home, job, said)
    try:
        return process.wait(LONGEST_SECONDS)
    except subprocess.TimeoutExpired:
        kill_all(process)
        raise Fell(f"it did not end in {LONGEST_SECONDS:.0f} s") from None


def kill_all(process: subprocess.Popen[bytes]) -> None:
    """Kill a command with all its processes."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def make_home(home: Path) -> None:
    """Make a recording, files to import, corrections, a kept run and a study to be run."""
    for name in ("out", "home", "source", "tmp"):
        (home / name).mkdir(parents=True)
    write_crossing(home / "recording", STEPS)
    toml(home / "source")
    detections(home / "source")
    write_log(home / "recording" / "corrections.toml", [make(kind="checked", first=0, last=3)])
    write_log(home / "more.toml", [make(kind="checked", first=10, last=20)])
    study = definition(home, STUDY, trials=4, propose=0).to_toml()
    (home / "study.toml").write_text(study, encoding="utf-8")
    first = Job("run", ("track", "recording", "-o", "out/tracks.csv"), "out/tracks.csv")
    said = home.parent / "said.txt"
    if run(home, first, said):
        raise Fell(said.read_text())
    for form in FORMS:
        (home / "out" / f"run.{form}").write_text("of an earlier run")
    shutil.rmtree(home / "home" / "stages", ignore_errors=True)  # what is tried computes its own


def files(home: Path) -> dict[str, bytes]:
    """Return every file that a person would miss, by its place; no caches and locks."""
    return {
        path.relative_to(home).as_posix(): _content(path)
        for path in home.rglob("*")
        if path.is_file() and not _is_own(path.relative_to(home))
    }


def _content(path: Path) -> bytes:
    """Return the bytes of a file; of an archive those that it holds, for it dates them."""
    if not zipfile.is_zipfile(path):
        return path.read_bytes()
    with zipfile.ZipFile(path) as archive:
        members = sorted(archive.namelist())
        held = b"".join(name.encode() + archive.read(name) for name in members)
    return _DATED.sub(b"", held)


def _is_own(place: Path) -> bool:
    """Whether a file is the program's own: a cache, a lock, a database that is judged apart."""
    return place.parts[0] in ("home", "tmp") or place.name.endswith(".lock")


def written(job: Job, contents: dict[str, bytes]) -> dict[str, bytes]:
    """Return what a command wrote, of all files."""
    return {
        name: data
        for name, data in contents.items()
        if name == job.writes or name.startswith(job.writes + "/")
    }


def runs_kept(home: Path) -> list[tuple[int, int]]:
    """Return number and rows of every kept run, of a library that is whole."""
    path = home / "home" / "library.sqlite3"
    with contextlib.closing(sqlite3.connect(path)) as connection:
        if connection.execute("PRAGMA integrity_check").fetchone() != ("ok",):
            raise Fell("the library is spoilt")
    if complaints := repair.check(path).complaints:
        raise Fell(f"the library complains: {complaints}")
    with Library(path) as library:
        return [(one.id, len(library.result(one.id).kept.tracks)) for one in library.runs()]


def trials_done(home: Path) -> dict[int, object]:
    """Return the values of a study's trials that ended."""
    found: list[Store] = stores(home / "home" / "studies")
    return {trial.number: trial.objectives for store in found for trial in store.trials()}


def temporary_files(home: Path) -> list[str]:
    """Return files that were begun and not finished."""
    return [str(path.relative_to(home)) for path in home.rglob(".*.part.*")]


@contextlib.contextmanager
def disk(place: Path, megabytes: float) -> Iterator[None]:
    """Mount a disk in memory on a folder."""
    place.mkdir(exist_ok=True)
    size = f"size={round(megabytes * 1024)}k"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(place)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(place)], check=True)


def can_mount() -> bool:
    """Whether this process may mount disks."""
    with tempfile.TemporaryDirectory() as name:
        line = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", name]
        if shutil.which("mount") is None or subprocess.run(line, capture_output=True).returncode:
            return False
        subprocess.run(["umount", name], check=True)
        return True


@contextlib.contextmanager
def full(disk_folder: Path, room: int) -> Iterator[None]:
    """Leave a disk so many bytes, rounded up to pages."""
    used = shutil.disk_usage(disk_folder).used
    line = ["mount", "-o", f"remount,size={used + room}", str(disk_folder)]
    subprocess.run(line, check=True)
    try:
        yield
    finally:
        line = ["mount", "-o", f"remount,size={DISK_MB}m", str(disk_folder)]
        subprocess.run(line, check=True)


@contextlib.contextmanager
def read_only(folder: Path) -> Iterator[None]:
    """Take away the right to write into a folder, for root as well."""
    subprocess.run(["mount", "--bind", str(folder), str(folder)], check=True)
    subprocess.run(["mount", "-o", "remount,ro,bind", str(folder)], check=True)
    try:
        yield
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def kill_at(process: subprocess.Popen[bytes], seconds: float, chance: Random) -> None:
    """Kill a command after some time: all its processes, or one of them."""
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and process.poll() is None:
        time.sleep(0.002)
    if process.poll() is not None:
        return
    own = psutil.Process(process.pid)
    with contextlib.suppress(psutil.NoSuchProcess):
        family = [own, *own.children(recursive=True)]
        if chance.random() < 0.5:
            chance.choice(family).kill()
            with contextlib.suppress(subprocess.TimeoutExpired):
                process.wait(20.0)  # what is left ends, or goes on to the end
            psutil.wait_procs(family, 20.0)
    kill_all(process)


@dataclass(frozen=True, slots=True)
class Usual:
    """What a command does without a fault."""

    seconds: float
    written: dict[str, bytes]
    kept: int
    used: int
    """Bytes that it takes of the disk."""


def usual(base: Path, job: Job, place: Path) -> Usual:
    """Run a command without a fault and return what it does."""
    home = place / "home"
    shutil.copytree(base, home)
    before = _bytes(home)
    begin = time.monotonic()
    if run(home, job, place / "said.txt"):
        raise Fell(f"{job.name}: {(place / 'said.txt').read_text()}")
    seconds = time.monotonic() - begin
    found = Usual(
        seconds, written(job, files(home)), len(runs_kept(home)), _bytes(home) - before + 65536
    )
    shutil.rmtree(home)
    return found


def _bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())


def try_one(base: Path, job: Job, fault: str, chance: Random, known: Usual, place: Path) -> str:
    """Run one trial.

    Returns:
        How the command ended: done, refused or killed.

    Raises:
        Fell: If something was lost or is half written; in words.
    """
    home = place / "home"
    shutil.copytree(base, home)
    before, kept, done = files(home), runs_kept(home), trials_done(home)
    own = written(job, before)
    said = place.parent / "said.txt"
    with contextlib.ExitStack() as held:
        if fault == "full disk":
            held.enter_context(full(place, int(chance.random() ** 2 * known.used)))
        elif fault == "read only":
            which = chance.choice(("out", "recording", "home", "."))
            held.enter_context(read_only(home / which))
        if fault == "kill":
            process = start(home, job, said)
            kill_at(process, chance.uniform(0.0, 1.1 * known.seconds), chance)
            status = process.returncode
        else:
            status = run(home, job, said)
    words = said.read_text(errors="replace")
    if fault == "kill":  # Python's own, where one process of several is killed
        words = _OF_SEMAPHORES.sub("", words)
    if "Traceback" in words:
        raise Fell(f"a traceback: {words[-1500:]}")
    after = files(home)
    theirs = written(job, after)
    if lost := [n for n, data in before.items() if n not in own and after.get(n) != data]:
        raise Fell(f"lost or altered: {lost}")
    if theirs not in (own, known.written):
        raise Fell(f"half written: {sorted(theirs)}")
    if new := [name for name in after if name not in before and name not in known.written
               and ".part." not in name]:  # fmt: skip
        raise Fell(f"left behind: {new}")
    if fault != "kill":
        if left := temporary_files(home):
            raise Fell(f"left behind: {left}")
        if status not in (0, 1, 2):
            raise Fell(f"it ended with status {status}: {words[-500:]}")
        if status == 0 and job.name != "study" and theirs != known.written:
            raise Fell("it said that it was done, and had written nothing")
        if status and not words.strip():
            raise Fell("it ended without a word")
    if missing := [one for one in kept if one not in runs_kept(home)]:
        raise Fell(f"kept runs were lost: {missing}")
    ended = trials_done(home)
    if any(ended.get(number) != told for number, told in done.items()):
        raise Fell("trials of the study were lost")
    if job.name == "import" and theirs == known.written:  # it refuses a folder with files
        shutil.rmtree(home / job.writes)
    if again := run(home, job, said):
        raise Fell(f"without a fault it ends with {again}: {said.read_text()[-1500:]}")
    if written(job, files(home)) != known.written:
        raise Fell("without a fault it wrote something else than it does otherwise")
    if len(runs_kept(home)) < known.kept:
        raise Fell("without a fault the run was not kept")
    if job.name == "study":
        finished = trials_done(home)
        if any(finished.get(number) != told for number, told in ended.items()):
            raise Fell("trials that had ended are others now")
        if sorted(finished) != [0, 1, 2, 3] or any(
            store.status().state != "done" for store in stores(home / "home" / "studies")
        ):
            raise Fell(f"the study is not whole: {sorted(finished)}")
    return "done" if status == 0 else "refused" if status > 0 else "killed"


def try_served(base: Path, fault: str, chance: Random, place: Path) -> str:
    """Make corrections in the workbench until a fault; all that it confirmed must be there.

    Raises:
        Fell: If a confirmed correction is lost or the log is half written.
    """
    home = place / "home"
    shutil.copytree(base, home)
    before = {name: data for name, data in files(home).items() if name != SERVED.writes}
    server = Server(home / "recording", home / "home", kernels=kernel_folder())
    try:
        server.wait_for_run()
        family = [psutil.Process(server.process.pid), server.serving]
        with contextlib.ExitStack() as held:
            if fault == "full disk":
                held.enter_context(full(place, int(chance.random() * 8192)))
            elif fault == "read only":
                held.enter_context(read_only(home / "recording"))
            until = time.monotonic() + chance.uniform(0.0, 0.4) if fault == "kill" else math.inf
            confirmed, refused = correct_until(server, until)
        for one in family if fault == "kill" else ():
            one.kill()
    finally:
        with contextlib.suppress(Exception):
            server.stop()
        server.process.kill()
    after = {name: data for name, data in files(home).items() if name != SERVED.writes}
    if lost := [name for name, data in before.items() if after.get(name) != data]:
        raise Fell(f"lost or altered: {lost}")
    listed = Job("list", ("corrections", "list", "recording", "--json"), "")
    listing = place / "listed.json"
    if run(home, listed, listing):
        raise Fell(listing.read_text())
    expected = confirmed + len(read_log(base / SERVED.writes))
    there = len(json.loads(listing.read_text()))
    if not expected <= there <= expected + 1:
        raise Fell(f"{expected} corrections were confirmed, {there} are there")
    return "killed" if fault == "kill" else "refused" if refused else "done"


def correct_until(server: Server, until: float) -> tuple[int, int]:
    """Make corrections one after the other, six unless there is a time to end at.

    Returns:
        How many were confirmed, and how many refused.

    Raises:
        Fell: If the workbench fails instead of refusing one.
    """
    confirmed = refused = 0
    for number in range(1, 7 if until == math.inf else 40):
        if time.monotonic() > until:
            break
        wish = {"kind": "checked", "first": number, "last": number}
        place, asked = f"{server.address}api/commands", {"name": "correct", "corrections": [wish]}
        answer = httpx2.post(place, json=asked, timeout=30.0)
        if answer.status_code >= 500 and answer.status_code != 507:
            raise Fell(f"status {answer.status_code}: {answer.text[:500]}")
        confirmed += answer.is_success
        refused += not answer.is_success
    return confirmed, refused


def run_trials(file: Path, seed: int, trials: list[int]) -> None:
    """Run trials in a home of their own, and note each as a line of the file."""
    faults = FAULTS if can_mount() else FAULTS[:1]
    with tempfile.TemporaryDirectory(prefix="multiview-phd-faults-") as name:
        folder = Path(name)
        base = folder / "base"
        make_home(base)
        usuals: dict[str, Usual] = {}
        for trial in trials:
            chance = Random(f"{seed} {trial}")
            fault = faults[trial % len(faults)]
            job = chance.choice([*jobs(), SERVED])
            place = folder / "trial"
            place.mkdir(exist_ok=True)
            if job is not SERVED and job.name not in usuals:
                usuals[job.name] = usual(base, job, place)
            why = ""
            try:
                with contextlib.nullcontext() if fault == "kill" else disk(place, DISK_MB):
                    if job is SERVED:
                        outcome = try_served(base, fault, chance, place)
                    else:
                        outcome = try_one(base, job, fault, chance, usuals[job.name], place)
            except Exception as error:
                outcome, why = "fell", f"{type(error).__name__}: {error}"
                print(f"FELL: trial {trial}, {job.name}, {fault}: {why}", flush=True)
            shutil.rmtree(place)
            row = {"trial": trial, "job": job.name, "fault": fault, "outcome": outcome, "why": why}
            with file.open("a", encoding="utf-8") as lines:
                lines.write(json.dumps(row) + "\n")


def main() -> int:
    """Run trials that the file does not have yet; 1 where something fell."""
    parser = argparse.ArgumentParser(prog="python3 -m tests.bad_input.faults", description=__doc__)
    parser.add_argument("file", type=Path, help="a line a trial; what it has is not run again")
    parser.add_argument("--trials", type=int, default=900)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    arguments = parser.parse_args()
    if not can_mount():
        print("faults: no disk can be mounted here, so that commands are killed only", flush=True)
    arguments.file.touch()
    known = {one["trial"] for one in map(json.loads, arguments.file.read_text().splitlines())}
    left = [trial for trial in range(arguments.trials) if trial not in known]
    with ProcessPoolExecutor(arguments.workers) as pool:
        shares = [left[first :: arguments.workers] for first in range(arguments.workers)]
        running = [
            pool.submit(run_trials, arguments.file, arguments.seed, share)
            for share in shares
            if share
        ]
        for one in running:
            one.result()
    rows = [json.loads(line) for line in arguments.file.read_text().splitlines()]
    counts = Counter((one["fault"], one["outcome"]) for one in rows)
    words = ", ".join(f"{fault}: {count} {how}" for (fault, how), count in sorted(counts.items()))
    print(f"faults: {len(rows)} trials: {words}", flush=True)
    return 1 if any(one["outcome"] == "fell" for one in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
