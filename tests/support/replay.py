"""The firmware steps that :mod:`stepping` kept, interpreted: ``NUMBA_DISABLE_JIT=1 python replay.py FILE``.

Each is compared with what the compiled step made of the same records.  Prints how many steps there were; exit 1 and
the fields that differ, if any do.
"""

from __future__ import annotations

import os
import sys

os.environ["NUMBA_DISABLE_JIT"] = "1"

import numpy as np
from stepping import STEP, pass_time

from pnfarm.table.compiled import IS_COMPILED

#: Compiled and interpreted code may round a transcendental function differently in the last digit.
RELATIVE = 1e-12


def _differences(name: str, before: np.ndarray, wanted: np.ndarray, got: np.ndarray) -> list[str]:
    told = []
    for field in wanted.dtype.names or ():
        right, wrong = wanted[field], got[field]
        alike = (
            np.allclose(right, wrong, rtol=RELATIVE, atol=1e-12, equal_nan=True)
            if right.dtype.kind == "f"
            else np.array_equal(right, wrong)
        )
        if not alike:
            told.append(f"{name}.{field}: {before[field]} became {right} compiled and {wrong} interpreted")
    return told


def _copy(record: np.void) -> np.ndarray:
    """An array of one record, padding and all, to be written to."""
    return np.frombuffer(bytearray(record.tobytes()), record.dtype).view(np.recarray)


def main(file: str) -> int:
    if IS_COMPILED:
        raise SystemExit("NUMBA_DISABLE_JIT=1 is not set")
    steps = np.fromfile(file, STEP)
    told: list[str] = []
    np.seterr(all="ignore")
    for number, step in enumerate(steps):
        axes, images = (_copy(step[name]) for name in ("axis", "image"))
        pass_time(axes, images, int(step["now"]), 0, 1, int(step["life"]), int(step["frame"]))
        for name, got in (("axis", axes), ("image", images)):
            if got.tobytes() != step[f"{name}_after"].tobytes():
                lines = _differences(name, step[name], step[f"{name}_after"], got[0])
                told += [f"step {number}: {line}" for line in lines]
    sys.stdout.write("\n".join((f"{len(steps)} steps, {len(told)} differences", *told[:40], "")))
    return 1 if told or not len(steps) else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
