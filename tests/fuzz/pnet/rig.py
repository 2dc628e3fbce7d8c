"""p-net (a PROFINET device in C) as the other implementation: the same sequences, and the class of each answer.

Its sample application runs in a network namespace of its own, as the device of another one; ours is a device of a farm
in memory and in virtual time, by the GSDML file of that sample.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import ExitStack
from ipaddress import IPv4Address, IPv4Interface
from pathlib import Path
from random import Random
from typing import Self

from bystander import Bystander
from device_cell import Cell

from pnfarm.protocols.ip.host import DatagramReceived
from pnfarm.protocols.profinet.gsdml.planning import PlannedDevice
from pnfarm.protocols.profinet.wire.dcp.pdu import IDENTIFY_MULTICAST
from pnfarm.protocols.profinet.wire.rpc.pdu import RPC_PORT
from pnfarm.wire.ethernet import ETHERTYPE_PROFINET, EthernetFrame, emit_ethernet, parse_ethernet
from tests.fuzz.pnet.base import ADDRESS, CONTROLLER, MODULES, NAME, OWN, Caller, Sent
from tests.fuzz.pnet.classes import answer_class
from tests.fuzz.pnet.dcp import set_address
from tests.interop.pnet_talk import answers

__all__ = ["Ours", "PnetRig", "compared", "farm_text"]

FARM = """devices:
  - {{name: {name}, gsdml: {gsdml}, ip: {address}/24, slots: {modules}}}
"""
#: UDP port of the requests.
ASKS = 49_170
#: Between two sequences, for ours: longer than a connection without data lasts.
REST_SECONDS = 3.0
START_SECONDS = 15.0
#: How long p-net may be deaf, as behind a new address, before it is started anew.
LOST_SECONDS = 1.2


def _back(rng: Random, device: PlannedDevice) -> list[Sent]:
    """A good connection and its end, by which a device is known to be as at the beginning."""
    caller = Caller(rng, device)
    return [caller.connect(), caller.release("Release")]


def farm_text(gsdml: Path) -> str:
    """The device as a farm file has it."""
    return FARM.format(name=NAME, gsdml=json.dumps(str(gsdml.resolve())), address=ADDRESS, modules=MODULES)


class Tester(Bystander):
    """Its station on the memory switch; ``arrived`` are answers and calls."""

    def __init__(self, cell: Cell) -> None:
        self.arrived: list[tuple[str, DatagramReceived]] = []
        super().__init__(cell.world, "tester", CONTROLLER, IPv4Interface(f"{OWN}/24"))
        self.ip.open_ports |= {ASKS, RPC_PORT}

    def other_datagram(self, event: DatagramReceived) -> None:
        self.arrived.append(("call" if event.destination_port == RPC_PORT else "rpc", event))


class Memory:
    """The end in memory (:class:`tests.interop.pnet_talk.End`)."""

    def __init__(self, cell: Cell) -> None:
        self.tester = Tester(cell)
        self.mac = cell.farm.station(NAME).port.mac
        self._caller = (IPv4Address(ADDRESS), RPC_PORT)

    def send(self, how: str, octets: bytes) -> None:
        tester = self.tester
        if how in {"rpc", "answer"}:
            tester.ip.learn(IPv4Address(ADDRESS), self.mac, tester.now)
            port, to = (ASKS, (IPv4Address(ADDRESS), RPC_PORT)) if how == "rpc" else (RPC_PORT, self._caller)
            tester.ip.send(port, *to, octets, tester.now)
            tester.settle()
        else:
            to = IDENTIFY_MULTICAST if how == "identify" else self.mac
            tester.send(emit_ethernet(EthernetFrame(to, CONTROLLER, ETHERTYPE_PROFINET, octets)))

    def more(self, seconds: float) -> tuple[str, bytes] | None:
        tester = self.tester
        found: list[tuple[str, bytes]] = []

        def heard() -> bool:
            while tester.heard and not found:
                frame = parse_ethernet(tester.heard.popleft())
                if frame.destination == CONTROLLER and frame.payload[:2] >= b"\xfe\xfc":
                    found.append(("dcp", frame.payload))
            if tester.arrived and not found:
                kind, event = tester.arrived.pop(0)
                if kind == "call":
                    self._caller = event.source_ip, event.source_port
                found.append((kind, event.data))
            return bool(found)

        return found[0] if tester.run(seconds, until=heard) else None

    def rest(self, seconds: float) -> None:
        """Time passes; what came late belongs to nothing."""
        self.tester.run(seconds)
        self.tester.heard.clear()
        self.tester.arrived.clear()


class Ours:
    """Our device."""

    def __init__(self, device: PlannedDevice, devices: str) -> None:
        """``devices``: that section of a farm file, with the device under its name and address."""
        self.device = device
        self.cell = Cell(devices, None)
        self.cell.world.run(1.0)
        self.end = Memory(self.cell)
        self.turns = Random(NAME)

    def _answers(self, sequence: list[Sent]) -> list[str]:
        found = answers(self.end, [(one.how, one.octets) for one in sequence], lambda: self.cell.world.now / 1e9)
        return [answer_class(sent, one) for sent, one in zip(sequence, found, strict=False)]

    def answers(self, sequence: list[Sent]) -> list[str]:
        found = self._answers(sequence)
        self.end.rest(REST_SECONDS)
        back = self._answers(_back(self.turns, self.device))
        if not all(one.startswith("OK") for one in back):
            raise AssertionError(f"behind the sequence, the device answers {back}")
        return found


class PnetRig:
    """The sample in its namespace, and who talks to it; a context.  It is started anew where it has ended."""

    def __init__(self, program: Path, device: PlannedDevice) -> None:
        self.program = program.resolve(strict=True)
        self.device = device
        self.turns = Random(NAME)
        #: How often it ended, and how often it was started after the first time.
        self.ends = self.restarts = 0

    def __enter__(self) -> Self:
        from tests.interop.interop_rig import Lab

        self._lab = Lab()
        mac = ":".join(f"{octet:02x}" for octet in CONTROLLER)
        self._lab.run("peer", "ip", "link", "set", "plc0", "address", mac)
        # it is a piece of cable, not a second card with the device's address
        self._lab.run("farm", "ip", "link", "set", "nic0", "arp", "off")
        self._lab.run("peer", "ip", "address", "add", f"{OWN}/24", "dev", "plc0")
        try:
            self._start()
        except BaseException:
            self._lab.close()
            raise
        return self

    def _start(self) -> None:
        from tests.interop.interop_rig import HERE
        from tests.interop.pnet_device import PnetDevice

        with ExitStack() as stack:
            folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="pnfarm-pnet-"))
            self._pnet = PnetDevice(self._lab, Path(folder), self.program)
            stack.callback(self._pnet.close)
            mac = self._lab.run("farm", "cat", "/sys/class/net/card0/address").stdout.strip()
            self._talk = self._lab.start(
                "peer", sys.executable, HERE / "pnet_talk.py", "plc0", ADDRESS, mac,
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )  # fmt: skip
            stack.callback(self._hang_up)
            # the card's address is another one each time
            self._lab.run("peer", "ip", "neigh", "flush", "dev", "plc0")
            end = time.monotonic() + START_SECONDS
            while self._answers([set_address()]) == ["no end"] or not self._is_back():
                if self._pnet.ended or time.monotonic() > end:
                    raise RuntimeError(f"{self.program} does not answer")
            self._running = stack.pop_all()

    def _hang_up(self) -> None:
        self._talk.stdin.close()
        self._talk.wait(10)
        self._talk.stdout.close()

    def _answers(self, sequence: list[Sent]) -> list[str]:
        self._talk.stdin.write(json.dumps([(one.how, one.octets.hex()) for one in sequence]) + "\n")
        self._talk.stdin.flush()
        line = self._talk.stdout.readline()
        if not line:
            raise RuntimeError("who talks to the other implementation has ended")
        found = [one if one in {"no end", "silence"} else bytes.fromhex(one) for one in json.loads(line)]
        return [answer_class(sent, one) for sent, one in zip(sequence, found, strict=False)]

    def _is_back(self) -> bool:
        """Whether a good connection is made and ended, within a moment."""
        end = time.monotonic() + LOST_SECONDS
        while not self._pnet.ended:
            found = self._answers(_back(self.turns, self.device))
            if [one[:2] for one in found] == ["OK", "OK"]:
                return True
            if time.monotonic() > end:
                return False
            time.sleep(0.05)  # it has no sign by which it says that it is back
        return False

    def answers(self, sequence: list[Sent]) -> list[str]:
        """The classes, up to ``ended`` where the program is gone; it is back when this returns."""
        found, is_back = self._answers(sequence), self._is_back()
        if is_back and "no end" in found:
            # it was only late, or a datagram was lost
            found, is_back = self._answers(sequence), self._is_back()
        if not is_back:
            if self._pnet.ended:
                self.ends += 1
                found = [*(one for one in found if one != "no end"), "ended"][: len(sequence)]
            self.restarts += 1
            self._running.close()
            self._start()
        return found

    def told(self) -> str:
        """What else there is to say of it at the end."""
        return f"; {self.ends} times it ended, {self.restarts} times it was started anew"

    def __exit__(self, *_: object) -> None:
        self._running.close()
        self._lab.close()


def compared(sequence: list[Sent], mine: list[str], theirs: list[str]) -> Iterator[tuple[Sent, str, str]]:
    """Each message with both classes of answer, up to the first that differs: what follows may follow from it."""
    for one, ours, other in zip(sequence, mine, theirs, strict=False):
        yield one, ours, other
        if ours != other:
            return
