"""``python -m pnfarm.plant.fmi.child``: the process of one FMU, which ends with the farm.

Its arguments are descriptors: of the connection to the farm, of a pipe that the farm's end closes, of the memory.
"""

from __future__ import annotations

import fcntl
import json
import mmap
import os
import resource
import select
import signal
import sys
import time
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pnfarm.plant.fmi.memory import DONE, END, ENDED, FAILED, MAX_STATE, REFUSED, RESTORE, SAVE, STEP
from pnfarm.plant.fmi.planned import MOST_MEMBERS
from pnfarm.vocabulary.zip_files import unpack_zip

if TYPE_CHECKING:
    from pnfarm.plant.fmi.loaded import LoadedFmu

__all__: list[str] = []

#: Most octets of an FMU, unpacked.
MAX_UNPACKED = 4 << 30


def _end_with(pipe: int) -> None:
    """Have the kernel kill this process when the farm's end of the pipe is closed, whatever the FMU does then."""
    fcntl.fcntl(pipe, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(pipe, fcntl.F_SETSIG, signal.SIGKILL)
    fcntl.fcntl(pipe, fcntl.F_SETFL, fcntl.fcntl(pipe, fcntl.F_GETFL) | os.O_ASYNC)
    if select.select([pipe], [], [], 0)[0]:
        sys.exit(0)


def _carry_out(fmu: LoadedFmu, asked: bytes, memory: Any) -> bytes:
    """Returns what is the answer, beside that it is done; after a step, why this is the last one."""
    if asked == SAVE:
        return fmu.save()
    if asked[:1] == RESTORE:
        fmu.restore(asked[1:])
    elif asked == STEP:
        asks_for_end = fmu.step()
        memory[ENDED] = time.perf_counter()
        if asks_for_end:
            return b"it asks for the end of the simulation"
    return b""


def _answer(fmu: LoadedFmu, asked: bytes, memory: Any) -> bytes:
    try:
        return DONE + _carry_out(fmu, asked, memory)
    except Exception as error:
        if asked == STEP:
            raise
        # it goes on with the state that it has
        return REFUSED + str(error).encode()


def main(connection: Connection, memory: Any) -> None:
    """Load the FMU, then do what the farm asks for until it says that this is the end."""
    fmu: LoadedFmu | None = None
    try:
        order = json.loads(connection.recv_bytes())
        unpack_zip(Path(order["path"]), Path(order["folder"]), MOST_MEMBERS, MAX_UNPACKED)
        # FMPy takes a while, and is for this process alone
        from pnfarm.plant.fmi.loaded import LoadedFmu  # noqa: PLC0415

        fmu = LoadedFmu(order, memory)
        fmu.start(order)
        connection.send_bytes(DONE)
        while (asked := connection.recv_bytes(MAX_STATE + 1)) != END:
            connection.send_bytes(_answer(fmu, asked, memory))
        fmu.close()
    except EOFError:
        return
    except Exception as error:  # noqa: BLE001 - whatever FMPy and the FMU raise is the farm's to report
        said = f"; it says: {fmu.message}" if fmu is not None and fmu.message else ""
        connection.send_bytes(FAILED + f"{error}{said}".encode())


if __name__ == "__main__":
    _end_with(int(sys.argv[2]))
    # a thread of the farm may have real-time priority; a core file takes seconds
    if os.sched_getscheduler(0) != os.SCHED_OTHER:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    _shared = mmap.mmap(int(sys.argv[3]), 0)
    main(Connection(int(sys.argv[1])), memoryview(_shared).cast("B").cast("d"))
    # without the ends of libraries, which may wait for ever
    os._exit(0)
