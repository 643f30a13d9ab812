"""Damage recordings for some minutes: ``python3 -m tests.bad_input MINUTES [--seed N]``.

With ``--cases 20000 --resume FILE`` it ends after so many, and goes on where the file says that it
was ended before; with ``--imports`` files of other programs are damaged and imported, too.

Every worker is a process of its own, so that a crash is reported as any other failure: with the
lines that the corpus takes (``tests/bad_input/corpus.json``), reduced to the damage that it needs.
"""

from __future__ import annotations

import argparse
import faulthandler
import json
import os
import resource
import secrets
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections import Counter
from pathlib import Path
from random import Random

from tracker.files.atomic import write_whole
from tracker.files.folders import cache_folder

HANG_SECONDS = 300.0
"""A worker that says nothing for so long is ended; its kernels may be compiled before. A case takes
a second, but on a machine with thirty other processes half a minute."""

COMPILE_SECONDS = 600.0

MEMORY_MB = 1024.0
"""What a case may take beyond what the worker had after the first good one."""


def main() -> int:
    """Run workers until the time is over; 1 where something fell."""
    parser = argparse.ArgumentParser(prog="python3 -m tests.bad_input", description=__doc__)
    parser.add_argument("minutes", type=float)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--workers", type=int, default=min(4, os.cpu_count() or 1))
    parser.add_argument(
        "--bounds", action="store_true", help="the kernels check every index, and are slower"
    )
    parser.add_argument(
        "--imports", action="store_true", help="files of other programs are damaged too"
    )
    parser.add_argument("--cases", type=int, default=None, help="end after so many")
    parser.add_argument("--resume", type=Path, default=None, help="keeps where it was ended")
    parser.add_argument("--work", type=int, default=None, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.work is not None:
        return work(arguments.work, time.monotonic() + 60.0 * arguments.minutes)
    if arguments.imports:
        os.environ["MULTIVIEW_PHD_DAMAGED_IMPORTS"] = "1"
    if arguments.bounds:  # machine code of its own, kept for the next time
        os.environ["NUMBA_BOUNDSCHECK"] = "1"
        os.environ["NUMBA_CACHE_DIR"] = str(cache_folder() / "kernels-with-bounds")
        print("fuzz: every index is checked", flush=True)
    seed = secrets.randbelow(2**40) if arguments.seed is None else arguments.seed
    print(f"fuzz: seed {seed}", flush=True)
    good = [sys.executable, "-m", "tests.bad_input", "0", "--work", "0"]
    if subprocess.run(good, stdout=subprocess.DEVNULL).returncode:  # compiles what is missing
        print("fuzz: a good recording does not run", flush=True)
        return 1
    deadline = time.monotonic() + 60.0 * arguments.minutes
    progress = Progress(
        [seed + 10**12 * k for k in range(arguments.workers)], arguments.cases, arguments.resume
    )
    counts = progress.counts
    threads = [
        threading.Thread(target=watch, args=(k, deadline, progress))
        for k in range(len(progress.seeds))
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    words = ", ".join(f"{count} {what}" for what, count in sorted(counts.items()))
    print(f"fuzz: {sum(counts.values())} damaged recordings: {words}", flush=True)
    return 1 if counts["fell"] else 0


class Progress:
    """The next case of each worker and the number of outcomes, kept in a file if there is one."""

    def __init__(self, seeds: list[int], cases: int | None, file: Path | None) -> None:
        self.seeds = seeds
        self.counts: Counter[str] = Counter()
        self._cases, self._file = cases, file
        self._lock = threading.Lock()
        if file is not None and file.exists():
            stored = json.loads(file.read_text(encoding="utf-8"))
            self.seeds, self.counts = stored["seeds"], Counter(stored["counts"])
            print(f"fuzz: goes on after {sum(self.counts.values())} cases", flush=True)

    @property
    def complete(self) -> bool:
        """Whether there were as many cases as are wanted."""
        return self._cases is not None and sum(self.counts.values()) >= self._cases

    def add(self, outcome: str) -> None:
        """Count a case."""
        with self._lock:
            self.counts[outcome] += 1
            if self._file is not None:
                stored = {"seeds": self.seeds, "counts": self.counts}
                write_whole(self._file, json.dumps(stored).encode())


def watch(number: int, deadline: float, progress: Progress) -> None:
    """Keep one worker running; a death of it is a finding, and the next case goes on."""
    while time.monotonic() < deadline - 1.0 and not progress.complete:
        with tempfile.TemporaryFile("w+") as errors:
            left = (deadline - time.monotonic()) / 60.0
            seed = str(progress.seeds[number])
            line = [sys.executable, "-m", "tests.bad_input", str(left), "--work", seed]
            worker = subprocess.Popen(line, stdout=subprocess.PIPE, stderr=errors, text=True)
            current = hear(worker, number, progress)
            status = worker.wait()
            if status != 0 and time.monotonic() < deadline and not progress.complete:
                progress.add("fell")
                errors.seek(0)
                said = "  ".join(errors.readlines()[-25:])
                tell_all(f"FELL: a worker ended with status {status} at\n  {current}\n  {said}")


def hear(worker: subprocess.Popen[str], number: int, progress: Progress) -> str:
    """Count what a worker tells until it ends, and end one that tells nothing any more.

    Returns:
        The case that was begun last.
    """
    assert worker.stdout is not None
    current = ""
    with Watchdog(worker) as dog:
        for text in worker.stdout:
            dog.heard()
            told = json.loads(text)
            if told["is"] != "good":
                dog.has_compiled()
            current = text.strip() if told["is"] == "begun" else current
            progress.seeds[number] = told.get("next", progress.seeds[number])
            if told["is"] in ("refused", "ran", "fell"):
                progress.add(told["is"])
            if told["is"] == "fell":
                tell_all(f"FELL: {told['why']}\n  {json.dumps(told['case'])}")
            if progress.complete:
                worker.terminate()
                break
    return current


class Watchdog:
    """Ends a process that is silent for :data:`HANG_SECONDS`, after it has said where it is."""

    def __init__(self, process: subprocess.Popen[str]) -> None:
        self._process = process
        self._timer: threading.Timer | None = None
        self._patience = COMPILE_SECONDS

    def __enter__(self) -> Watchdog:
        self.heard()
        return self

    def __exit__(self, *_: object) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def has_compiled(self) -> None:
        """From now on no silence is long."""
        self._patience = HANG_SECONDS

    def heard(self) -> None:
        """It is not silent."""
        self.__exit__()
        self._timer = threading.Timer(self._patience, self._bite)
        self._timer.daemon = True
        self._timer.start()

    def _bite(self) -> None:
        self._process.send_signal(signal.SIGABRT)  # its traceback tells where it hangs
        time.sleep(1.0)
        self._process.kill()


def tell_all(words: str) -> None:
    """One piece of output, whole."""
    print(words, flush=True)


def work(seed: int, deadline: float) -> int:
    """One worker: a case a seed, told as a line of JSON before and after."""
    from tests.bad_input.cases import FOREIGN, LONGEST_SECONDS, Fell, make_bases, try_case
    from tests.bad_input.drawing import Damage, drawn

    faulthandler.enable()

    def tell(**values: object) -> None:
        sys.stdout.write(json.dumps(values) + "\n")
        sys.stdout.flush()

    def memory() -> float:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0

    with tempfile.TemporaryDirectory(prefix="multiview-phd-fuzz-") as folder:
        bases = make_bases(Path(folder) / "bases")
        place = Path(folder) / "work"
        place.mkdir()
        for base in bases.values():
            try_case(base, [], place)
            tell(**{"is": "good"})
        usual = memory()
        imports = "MULTIVIEW_PHD_DAMAGED_IMPORTS" in os.environ
        drawn_from = [name for name in bases if imports or name != FOREIGN]

        def fault(base: str, damages: list[Damage]) -> str | None:
            try:
                told = try_case(bases[base], damages, place, LONGEST_SECONDS)
            except Fell as fell:
                return str(fell)
            except BaseException as error:
                last = traceback.extract_tb(error.__traceback__)[-1]
                where = f"{Path(last.filename).name}:{last.lineno}"
                return f"{type(error).__name__} at {where}: {str(error)[:300]}"
            outcome.append("refused" if told else "ran")
            return None

        while time.monotonic() < deadline:
            random = Random(seed)
            base, damages = random.choice(drawn_from), drawn(random)
            case = {"base": base, "damages": [one.to_json() for one in damages]}
            tell(**{"is": "begun", "case": case, "next": seed + 1})
            outcome: list[str] = []
            why = fault(base, damages)
            grown = memory() - usual
            if why is None and grown > MEMORY_MB:
                why = f"it took {grown:.0f} MB more than a good one"
                usual = memory()
            if why is not None:
                for one in list(damages):
                    fewer = [other for other in damages if other is not one]
                    if fault(base, fewer) is not None:
                        damages = fewer
                case["damages"] = [one.to_json() for one in damages]
                tell(**{"is": "fell", "why": why, "case": case})
            else:
                tell(**{"is": outcome[0]})
            seed += 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
