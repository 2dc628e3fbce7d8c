"""One process of a benchmark: a farm, a controller, or the floor, driven by commands on standard input.

``python -m pnfarm.bench.child ROLE`` reads one JSON line of settings, then one command a line, and
answers each with one JSON line.
"""

from __future__ import annotations

import json
import os
import resource
import socket
import subprocess
import sys
import threading
import time
from typing import Any

import anyio
import anyio.to_thread

from pnfarm.farm.process.garbage import keep_what_is_loaded, search_seldom
from pnfarm.farm.process.heap import keep_heap_small
from pnfarm.links.serial.eager_loop import LOOKING
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET


def cpu_seconds() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def _plant_cpu() -> float:
    """Of the threads of models in Python, to the nanosecond."""
    spent = 0
    for thread in threading.enumerate():
        if thread.name.startswith("pnfarm plant"):
            with open(f"/proc/self/task/{thread.native_id}/schedstat", encoding="ascii") as file:  # noqa: PTH123 - one read of a kernel file
                spent += int(file.read().split()[0])
    return spent / 1e9


def _rss() -> int:
    with open("/proc/self/statm", encoding="ascii") as file:  # noqa: PTH123 - one read of a kernel file
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


def say(answer: dict[str, Any]) -> None:
    sys.stdout.write(json.dumps(answer) + "\n")
    sys.stdout.flush()


def _counters(core: Any) -> dict[str, Any]:
    engine = core.columns.engine[0]
    return {
        "frames": int(engine.sent) + int(engine.received),
        "expirations": int(core.columns.cpm.expirations.sum()),
        "overruns": int(engine.overruns),
        "lateness": [int(n) for n in engine.lateness],
        "cpu": cpu_seconds(),
        # of the event loop alone: it runs the commands
        "loop_cpu": time.thread_time(),
        "plant_cpu": _plant_cpu(),
        "wall": time.monotonic(),
        "send_errors": int(engine.send_errors),
        # to and from the event loop
        "heard": core.link.counters.received,
        "said": core.link.counters.sent,
    }


def _punctuality(core: Any) -> dict[str, Any]:
    """Of each consumer: the sum of the intervals between its frames, and how many these were.

    ``skipped``: the cycles for which the own providers were too late.
    """
    cpm = core.columns.cpm
    return {
        "skipped": int(core.columns.ppm.late.sum()),
        "interval_ns": [int(n) for n in cpm.interval_sum_ns],
        "intervals": [int(n) for n in cpm.intervals.sum(axis=1)],
    }


def difference(before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    return {
        key: [a - b for a, b in zip(value, before[key], strict=True)]
        if isinstance(value, list)
        else value - before[key]
        for key, value in after.items()
    }


async def _settled(core: Any, stations: int, seconds: float) -> dict[str, Any]:
    """The counters once the event loop hears no more than what goes on for ever, at the latest after so long."""
    few = stations // 10 + 5
    with anyio.move_on_after(seconds):
        while True:
            before = core.link.counters.received
            # frames of so long are counted: a start has pauses of some tenths of a second
            await anyio.sleep(0.5)
            if core.link.counters.received - before < few:
                break
    return _counters(core)


async def _running(controllers: Any, seconds: float) -> bool:
    """Whether every axis is in operation within this time."""
    with anyio.move_on_after(seconds):
        while not controllers.all_running:  # noqa: ASYNC110 - axes have no events to wait for
            await anyio.sleep(0.005)
        return True
    return False


async def _commands(core: Any, stations: int, connected: Any) -> None:
    while line := await anyio.to_thread.run_sync(sys.stdin.readline):
        word, _, argument = line.strip().partition(" ")
        if word == "connected":
            say({"connected": await connected(float(argument))})
        elif word == "running":
            say({"running": await _running(core, float(argument))})
        elif word == "settled":
            say(await _settled(core, stations, float(argument)))
        elif word == "measure":
            before = _counters(core)
            await anyio.sleep(float(argument))
            say(difference(before, _counters(core)))
        elif word == "mark":
            say(_counters(core))
        elif word == "punctuality":
            say(_punctuality(core))
        elif word == "rss":
            say({"rss": _rss()})
        else:
            return


async def _farm(settings: dict[str, Any]) -> None:
    from pnfarm.farm.farm import Farm
    from pnfarm.farm.file.reading import parse_farm
    from pnfarm.station.event_log import EventLog

    config = parse_farm(settings["file"])
    async with Farm(config, log=EventLog(quiet=True)) as farm, anyio.create_task_group() as tasks:
        if config.api is not None:
            from pnfarm.api import serve_farm

            await tasks.start(serve_farm, farm)
        keep_what_is_loaded()
        say({"up": True, **_counters(farm.core)})

        async def connected(seconds: float) -> bool:
            with anyio.move_on_after(seconds):
                while not all(s.device.connected for s in farm.core.stations):  # noqa: ASYNC110 - stations have no events to wait for
                    await anyio.sleep(0.005)
                return True
            return False

        await _commands(farm.core, len(farm.core.stations), connected)
        tasks.cancel_scope.cancel()


async def _plc(settings: dict[str, Any]) -> None:
    """With ``hold`` the controller opens its connections only when it is asked for ``connected``."""
    from pnfarm.controller.runtime import Plc
    from pnfarm.farm.file.reading import parse_farm
    from pnfarm.station.event_log import EventLog

    plc = Plc(parse_farm(settings["file"]), log=EventLog(quiet=True))
    if not settings.get("hold"):
        async with plc:
            keep_what_is_loaded()
            say({"up": True})
            await _commands(plc.core, len(plc.core.snapshot()), plc.wait_connected)
        return
    say({"up": True})
    seconds = float(sys.stdin.readline().split()[1])
    before = cpu_seconds()
    async with plc:
        connected = await plc.wait_connected(seconds)
        say({"connected": connected, "cpu": cpu_seconds() - before})
        await _commands(plc.core, len(plc.core.snapshot()), plc.wait_connected)


def _floor(settings: dict[str, Any]) -> None:
    from pnfarm.engine.floor import make_vectors, run_floor
    from pnfarm.engine.realtime import RealTimeReport, RealTimeSettings, ask_kernel
    from pnfarm.engine.sockets.receive_ring import open_receive_ring, receive_ring

    addresses = [(index, bytes.fromhex(source), bytes.fromhex(to)) for index, source, to in settings["addresses"]]
    packet = bytes.fromhex(settings.get("packet", ""))
    ethertype = int.from_bytes(packet[:2], "big") or ETHERTYPE_PROFINET
    vectors = make_vectors(addresses, packet)
    scheduled = RealTimeSettings(**settings["scheduled"])
    with socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0) as sock:
        sock.setsockopt(socket.SOL_SOCKET, getattr(socket, "SO_RCVBUFFORCE", 33), 16 << 20)
        # bound to the interface if there is one, otherwise to all, as the engine's socket is
        sock.bind((settings["interface"], ethertype)) if settings["interface"] else _bind_all(sock, ethertype)
        ring = open_receive_ring(sock, len(addresses)) if settings.get("ring") else receive_ring(0)

        def run(seconds: float) -> None:
            # as the engine's thread: the kernel's default timer slack would make the floor late
            ask_kernel(scheduled, RealTimeReport())
            until = time.monotonic_ns() + int(seconds * 1e9)
            run_floor(
                sock.fileno(), ring, vectors.rx, vectors.tx, settings["groups"], vectors.counts, vectors.lateness,
                vectors.times, settings["period"], until,
            )  # fmt: skip

        # compiled or loaded, in a thread whose scheduling nobody needs
        first = threading.Thread(target=run, args=(0.001,))
        first.start()
        first.join()
        say({"up": True})
        while line := sys.stdin.readline():
            word, _, argument = line.strip().partition(" ")
            if word != "measure":
                return
            vectors.counts[:] = 0
            vectors.lateness[:] = 0
            before, start = cpu_seconds(), time.monotonic()
            # in a thread of its own, as the engine runs
            thread = threading.Thread(target=run, args=(float(argument),))
            thread.start()
            thread.join()
            say(
                {
                    "frames": int(vectors.counts[:2].sum()),
                    "lateness": [int(n) for n in vectors.lateness],
                    "cpu": cpu_seconds() - before,
                    "wall": time.monotonic() - start,
                }
            )


def _bind_all(sock: socket.socket, ethertype: int) -> None:
    import ctypes

    # sockaddr_ll with interface 0; Python's own bind needs a name
    address = (socket.AF_PACKET).to_bytes(2, sys.byteorder) + ethertype.to_bytes(2, "big") + bytes(16)
    if ctypes.CDLL(None, use_errno=True).bind(sock.fileno(), address, len(address)):
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def _leave(interface: str) -> None:
    """Enter a network namespace, wait for the parent to move ``interface`` into it, and bring it up."""
    import ctypes

    if ctypes.CDLL(None, use_errno=True).unshare(0x40000000):  # CLONE_NEWNET
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))
    say({"pid": os.getpid()})
    sys.stdin.readline()
    subprocess.run(["ip", "link", "set", interface, "up"], check=True)


def main() -> None:
    """See the module's head."""
    role = sys.argv[1]
    settings = json.loads(sys.stdin.readline())
    if settings.get("interface_from_outside"):
        _leave(settings["interface_from_outside"])
    os.sched_setaffinity(0, {settings["cpu"]})
    keep_heap_small()
    search_seldom()
    if role == "floor":
        _floor(settings)
    else:
        anyio.run(_farm if role == "farm" else _plc, settings, backend_options=LOOKING)


if __name__ == "__main__":
    main()
