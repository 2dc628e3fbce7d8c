"""How fast an answer can leave on this machine's serial lines: measured, for ``pnfarm doctor``.

The floor is a pty: a process of its own asks, the event loop of this one answers at once.  No port is faster.  A port
with its transmitter and receiver joined (a loop-back plug, or an RS-485 adapter that hears itself) is measured itself.
``python -m pnfarm.links.serial.probe PATH COUNT`` is the process that asks.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from pnfarm.errors import EnvironmentError_
from pnfarm.links.serial.descriptor import PtyLine, open_port
from pnfarm.links.serial.link import OCTET_BITS

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["ReplyTime", "floor", "latency_timer_ms", "loop_back"]

_ROOT = Path(__file__).resolve().parents[3]
QUESTION = b"a question of the doctor's"
_SECONDS = 10.0
#: A port whose echo has not come by then has none.
_ECHO_SECONDS = 0.2
_ECHOES = 20


@dataclass(frozen=True, slots=True)
class ReplyTime:
    """From the last octet of a question to the first one of its answer, ns: the median, and the 99th of 100."""

    median_ns: int
    slow_ns: int

    @classmethod
    def of(cls, times: Sequence[int]) -> ReplyTime:
        in_order = sorted(times)
        return cls(in_order[len(in_order) // 2], in_order[len(in_order) * 99 // 100])


def floor(count: int = 500) -> ReplyTime:
    """What a pty takes; raises :class:`EnvironmentError_` where none can be made, or nothing comes back in time."""
    return asyncio.run(_floor(count))


async def _floor(count: int) -> ReplyTime:
    line = PtyLine()
    line.set_receiver(lambda octets, _: line.send(octets))
    await line.open()
    try:
        asking = await asyncio.create_subprocess_exec(
            sys.executable, "-m", __name__, line.path, str(count),
            stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.DEVNULL, cwd=_ROOT,
        )  # fmt: skip
        try:
            async with asyncio.timeout(_SECONDS):
                told, _ = await asking.communicate()
        except TimeoutError as exc:
            asking.kill()
            await asking.wait()
            raise EnvironmentError_(f"a pty answered less than {count} times in {_SECONDS:.0f} s") from exc
    finally:
        await line.close()
    try:
        return ReplyTime.of([int(each) for each in json.loads(told)])
    except (ValueError, TypeError, IndexError) as exc:
        raise EnvironmentError_("the reply time of a pty could not be measured") from exc


def ask(path: str, count: int) -> list[int]:
    """How long each of ``count`` questions over a terminal took, ns."""
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
    times: list[int] = []
    try:
        # the first ones wait until the farm notices that the far end is connected
        for _ in range(count + 20):
            begun = time.perf_counter_ns()
            os.write(fd, QUESTION)
            missing = len(QUESTION)
            while missing:
                missing -= len(os.read(fd, missing))
            times.append(time.perf_counter_ns() - begun)
    finally:
        os.close(fd)
    return times[20:]


def loop_back(port: str, baud: int) -> ReplyTime | None:
    """What a port takes in addition to its octets; None where nothing comes back.

    Raises :class:`EnvironmentError_` where it cannot be opened.
    """
    opened = open_port(port, baud)
    own_ns = len(QUESTION) * OCTET_BITS * 1_000_000_000 // baud
    times: list[int] = []
    try:
        opened.reset_input_buffer()
        for _ in range(_ECHOES):
            begun, got = time.perf_counter_ns(), 0
            opened.write(QUESTION)
            while got < len(QUESTION):
                got += len(opened.read(len(QUESTION) - got))
                if time.perf_counter_ns() - begun > own_ns + _ECHO_SECONDS * 1e9:
                    return None
            times.append(max(0, time.perf_counter_ns() - begun - own_ns))
    except OSError as exc:
        raise EnvironmentError_(f"serial port {port} failed while it was measured: {exc}") from exc
    finally:
        opened.close()
    return ReplyTime.of(times)


def latency_timer_ms(port: str) -> int | None:
    """For how long the adapter's driver collects octets before it hands them on; None where it does not say."""
    name = Path(port).resolve().name
    try:
        text = Path(f"/sys/class/tty/{name}/device/latency_timer").read_text(encoding="ascii").strip()
    except (OSError, UnicodeDecodeError):
        return None
    return int(text) if text.isdecimal() else None


if __name__ == "__main__":
    print(json.dumps(ask(sys.argv[1], int(sys.argv[2]))))  # noqa: T201 - what the other process reads
