"""A soak of many hours in pieces, each a run of its own with a seed of its own; a stopped one is gone on with."""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import ctypes
import json
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.soak.judge import Check, shown
from tests.soak.kept import ROOT, Kept, KeptError, commit, machine
from tests.soak.report import failed, page, verdict

__all__ = ["main", "run_pieces"]

#: Below it a piece says nothing: a failed one ends the soak, a broken-off one is not kept.
SHORTEST_SECONDS = 60.0
INTERRUPTED = 130
_PR_SET_PDEATHSIG = 1

#: Runs one piece: seconds, seed and the file of its report in, its exit code out.
Run = Callable[[float, int, Path], int]


def run_pieces(kept: Kept, path: Path, run: Run, seconds: float, *, shortest: float = SHORTEST_SECONDS) -> int:
    """Run pieces for so many seconds, or until nothing is left; each that ends is written to ``path``.

    The exit code: 0; that of a piece that could not even begin; 130 if a piece was interrupted.
    """
    out = path.with_name(f"{path.name}.piece")
    while kept.left > 0 and seconds > 0:
        length = min(kept.left, seconds, kept.options["piece"])
        number, seed = kept.number, kept.seed
        print(f"piece {number}, seed {seed}, {length / 60:.0f} min; {kept.left / 3600:.2f} h are left", flush=True)
        out.unlink(missing_ok=True)
        began, sources = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime()), commit()
        code = run(length, seed, out)
        piece = json.loads(out.read_text("utf-8")) if out.exists() else {"seconds": 0.0}
        out.unlink(missing_ok=True)
        if piece["seconds"] >= min(shortest, length):
            kept.pieces.append(
                {"number": number, "seed": seed, "commit": sources, "began": began, "code": code,
                 "machine": machine(), **piece}
            )  # fmt: skip
            kept.write(path)
        if code == INTERRUPTED or piece["seconds"] < min(shortest, length):
            return code or 1
        seconds -= length
    return 0


class _Piece:
    """A piece is this program again, in a process of its own, that ends with this one, and when this one is stopped."""

    def __init__(self, options: argparse.Namespace) -> None:
        self._options = options
        self._process: subprocess.Popen[bytes] | None = None
        self._stopped = False
        for each in (signal.SIGINT, signal.SIGTERM):
            signal.signal(each, self._stop)

    def _stop(self, number: int, frame: object) -> None:
        del number, frame
        self._stopped = True
        if self._process is not None:
            self._process.terminate()

    def __call__(self, seconds: float, seed: int, out: Path) -> int:
        options, libc = self._options, ctypes.CDLL(None)
        command = [
            sys.executable, "-m", "tests.soak", "--hours", repr(seconds / 3600), "--seed", str(seed), "--out", str(out),
            "--drives", str(options.drives), "--rate", repr(options.rate), "--link", options.link,
            *(["--virtual"] if options.virtual else []),
        ]  # fmt: skip
        if not self._stopped:
            self._process = subprocess.Popen(
                command, cwd=ROOT, start_new_session=True,
                preexec_fn=lambda: libc.prctl(_PR_SET_PDEATHSIG, signal.SIGTERM),  # noqa: PLW1509 - no thread runs
            )  # fmt: skip
            if self._stopped:
                self._process.terminate()
            code = self._process.wait()
        return INTERRUPTED if self._stopped else code


def main(options: argparse.Namespace) -> int:
    """0: all that was run held; 1: something did not; 2: another soak's file; otherwise a piece's own code."""
    path: Path = options.state
    wanted: dict[str, Any] = vars(options)
    try:
        kept = Kept.read(path) if options.report else Kept.of(path, wanted)
    except KeptError as exc:
        sys.stderr.write(f"tests.soak: {exc}\n")
        return 2
    if options.report:
        options.report.write_text(page(kept), encoding="utf-8")
        return 0
    code = run_pieces(kept, path, _Piece(options), options.during or kept.left)
    checks: list[Check] = verdict(kept)
    print(f"\n{kept.seconds / 3600:.2f} of {kept.options['hours']:g} h in {len(kept.pieces)} pieces, in {path}")
    print(shown(checks), flush=True)
    return code or int(failed(checks))
