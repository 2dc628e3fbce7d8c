"""The firmware steps that :mod:`stepping` kept, interpreted: ``NUMBA_DISABLE_JIT=1 python replay.py FOLDER``.

Each is compared, octet for octet, with what the compiled step made of the same records.  All are done on plain Python
objects in the records' place (:mod:`plain_record`), some on the records themselves, as under a debugger, too.  Prints
how many steps there were; exit 1 and the fields that differ, if any do.
"""

from __future__ import annotations

import os
import struct
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any

os.environ["NUMBA_DISABLE_JIT"] = "1"

import numpy as np
from plain_record import octets, plain
from stepping import STEP, pass_time

from pnfarm.table.compiling.compiled import IS_COMPILED

#: Compiled and interpreted code may round a transcendental function differently in the last digit.
RELATIVE = 1e-12
#: One step of so many is done on the records themselves.
RECORDS_EVERY = 8
#: Steps that one process does at a time.
PART = 256
NAMES = ("axis", "image")


def _differences(name: str, before: Any, wanted: Any, got: Any) -> list[str]:
    told = []
    for field in wanted.dtype.names or ():
        right, wrong = wanted[field], got[field]
        if right.dtype.names is not None:
            for place in np.ndindex(right.shape):
                inner = f"{name}.{field}{list(place) if place else ''}"
                told += _differences(inner, before[field][place], right[place], wrong[place])
            continue
        alike = (
            np.allclose(right, wrong, rtol=RELATIVE, atol=1e-12, equal_nan=True)
            if right.dtype.kind == "f"
            else np.array_equal(right, wrong)
        )
        if not alike:
            told.append(f"{name}.{field}: {before[field]} became {right} compiled and {wrong} interpreted")
    return told


def on_records(step: Any) -> tuple[bytes, ...]:
    """The records' octets behind a kept step, done on the records themselves, padding and all."""
    records = [np.frombuffer(bytearray(step[name].tobytes()), step[name].dtype).view(np.recarray) for name in NAMES]
    pass_time(*records, int(step["now"]), 0, 1, int(step["life"]), int(step["frame"]))
    return tuple(record.tobytes() for record in records)


def on_plain_objects(step: Any) -> tuple[bytes, ...]:
    """The records' octets behind a kept step, done on Python objects in their place."""
    stand_ins = [plain(step[name]) for name in NAMES]
    pass_time(*([it] for it in stand_ins), int(step["now"]), 0, 1, int(step["life"]), int(step["frame"]))
    return tuple(octets(it, step[name].dtype) for it, name in zip(stand_ins, NAMES, strict=True))


def compare(step: Any, way: Callable[[Any], tuple[bytes, ...]]) -> list[str]:
    """What one kept step came to, interpreted one way or the other, that the compiled step did not."""
    try:
        behind = way(step)
    except (ArithmeticError, AttributeError, IndexError, TypeError, ValueError, struct.error) as error:
        return [f"{way.__name__}: {type(error).__name__}: {error}"]
    told = []
    for name, got in zip(NAMES, behind, strict=True):
        wanted = step[f"{name}_after"]
        if got != wanted.tobytes():
            told += _differences(name, step[name], wanted, np.frombuffer(got, wanted.dtype)[0])
    return told


def differing(file: Path, start: int) -> list[str]:
    """What is wrong with some of a file's steps, from ``start`` on."""
    told = []
    for number, step in enumerate(np.fromfile(file, STEP, PART, offset=start * STEP.itemsize), start):
        lines = compare(step, on_plain_objects)
        if number % RECORDS_EVERY == 0:
            lines += compare(step, on_records)
        told += [f"{file.name}, step {number}: {line}" for line in lines]
    return told


def main(folder: str) -> int:
    if IS_COMPILED:
        raise SystemExit("NUMBA_DISABLE_JIT=1 is not set")
    np.seterr(all="ignore")  # the processes inherit it
    files = [(file, file.stat().st_size // STEP.itemsize) for file in sorted(Path(folder).iterdir())]
    parts = [(file, start) for file, steps in files for start in range(0, steps, PART)]
    with ProcessPoolExecutor(mp_context=get_context("fork")) as pool:
        told = [line for lines in pool.map(differing, *zip(*parts, strict=True)) for line in lines] if parts else []
    count = sum(steps for _, steps in files)
    sys.stdout.write("\n".join((f"{count} steps, {len(told)} differences", *told[:40], "")))
    return 1 if told or not count else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
