"""Runs this project's programs as forks of a process that has loaded them already: ``fork_server.py SOCKET``.

A start of the program spends two to three seconds of a processor on imports and machine code.  A fork has both, and is
else a process like any other: own output, environment, folder, namespaces, signals and end.

A request is one packet of JSON on the socket (a file descriptor's number): ``program`` (a module with ``main()``, or
a script's path), ``arguments``, ``environment``, ``folder``, and optionally ``namespaces`` (the process whose ones are
entered).  With it come the descriptors of standard input, output and error, of the network namespace to be in, and of
a pipe: the process id and, at the end, the wait status are written to it.  The end of the socket ends the children.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import importlib
import json
import os
import pkgutil
import runpy
import selectors
import signal
import socket
import struct
import sys
from pathlib import Path

MOST_OCTETS = 1 << 17
DESCRIPTORS = 5
PR_SET_PDEATHSIG = 1
CLONE_NEWNS, CLONE_NEWUSER, CLONE_NEWNET = 0x00020000, 0x10000000, 0x40000000
#: What a number of a child takes in the pipe: process ids and wait statuses.
NUMBER = struct.Struct("!i")
#: Packages whose modules are imported one by one: commands and what they share.
COMMANDS = ("pnfarm.cli", "pnfarm.terminal", "pnfarm.buses.profinet.commands")
#: What those import once they run.
MODULES = ("pnfarm.api.app", "pnfarm.controller.runtime", "pnfarm.farm.farm", "httpx", "rich.live", "typer.rich_utils")

_libc = ctypes.CDLL(None, use_errno=True)


def preload() -> None:
    """Everything that a program of this project imports or loads before it does something."""
    for package in COMMANDS:
        for found in pkgutil.iter_modules(importlib.import_module(package).__path__, f"{package}."):
            importlib.import_module(found.name)
    for module in MODULES:
        importlib.import_module(module)
    importlib.import_module("pnfarm.engine.warm").warm()
    gc.collect()
    gc.freeze()


def _set_namespace(descriptor: int, kind: int) -> None:
    if _libc.setns(descriptor, kind) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def _enter(pid: int) -> None:
    for name, kind in (("user", CLONE_NEWUSER), ("net", CLONE_NEWNET), ("mnt", CLONE_NEWNS)):
        path = Path(f"/proc/{pid}/ns/{name}")
        if path.samefile(f"/proc/self/ns/{name}"):
            continue  # entering one's own user namespace is refused
        with path.open("rb") as file:
            _set_namespace(file.fileno(), kind)


def _become(request: dict[str, object], descriptors: list[int]) -> None:
    """In the child: what a process is given by who starts it."""
    *standard, network, _ = descriptors
    signal.signal(signal.SIGINT, signal.default_int_handler)
    for number in (signal.SIGHUP, signal.SIGTERM):
        signal.signal(number, signal.SIG_DFL)
    for number, descriptor in enumerate(standard):
        os.dup2(descriptor, number)
    if os.fstat(network).st_ino != Path("/proc/self/ns/net").stat().st_ino:
        _set_namespace(network, CLONE_NEWNET)
    for descriptor in descriptors:
        os.close(descriptor)
    os.chdir(str(request["folder"]))
    if request.get("namespaces"):
        _enter(int(str(request["namespaces"])))
        os.chdir(str(request["folder"]))
    os.environ.clear()
    os.environ.update(request["environment"])  # type: ignore[arg-type]
    _libc.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def serve(asked: socket.socket) -> dict[str, object] | None:
    """Fork for each request.  Returns in each child, with its request, and in the parent when the socket ended."""
    children: dict[int, tuple[int, int]] = {}
    with selectors.DefaultSelector() as selector:
        selector.register(asked, selectors.EVENT_READ)
        while True:
            for key, _ in selector.select():
                if key.fileobj is asked:
                    packet, descriptors, _, _ = socket.recv_fds(asked, MOST_OCTETS, DESCRIPTORS)
                    if not packet:
                        for pid, _ in children.values():
                            with contextlib.suppress(ProcessLookupError):
                                os.kill(pid, signal.SIGTERM)
                        return None
                    request = json.loads(packet)
                    pid = os.fork()
                    if pid == 0:
                        for watched in (*children, asked.fileno()):
                            os.close(watched)
                        for _, pipe in children.values():
                            os.close(pipe)
                        asked.detach()
                        _become(request, descriptors)
                        return request
                    *others, pipe = descriptors
                    for descriptor in others:
                        os.close(descriptor)
                    os.write(pipe, NUMBER.pack(pid))
                    watch = os.pidfd_open(pid)
                    children[watch] = pid, pipe
                    selector.register(watch, selectors.EVENT_READ)
                else:
                    selector.unregister(key.fd)
                    pid, pipe = children.pop(key.fd)
                    os.close(key.fd)
                    _, status = os.waitpid(pid, 0)
                    with contextlib.suppress(BrokenPipeError):
                        os.write(pipe, NUMBER.pack(status))
                    os.close(pipe)


def run(program: str, arguments: list[str]) -> None:
    """Run a module's ``main()``, or a script, as if it were the one that this interpreter was started for."""
    sys.argv = [program, *arguments]
    if program.endswith(".py"):
        sys.path[0] = str(Path(program).parent)
        runpy.run_path(program, run_name="__main__")
    else:
        sys.exit(importlib.import_module(program).main())


if __name__ == "__main__":
    # the terminal's Ctrl-C is for the children
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    preload()
    if (wanted := serve(socket.socket(fileno=int(sys.argv[1])))) is not None:
        run(str(wanted["program"]), list(wanted["arguments"]))  # type: ignore[call-overload]
