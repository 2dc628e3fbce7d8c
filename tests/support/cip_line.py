"""Drives on EtherNet/IP under plain scanners that come back by themselves, with a fault manager: as ``fault_line``.

A scanner makes its session and its connection, enables the drive, acknowledges its faults, and begins anew whenever
something is lost.  It stands in for a controller in tests of faults, so that these depend on the drives alone.
"""

from __future__ import annotations

import sys
from ipaddress import IPv4Address, IPv4Interface
from pathlib import Path
from types import SimpleNamespace
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "buses" / "ethernetip"))

from peer import OWN, Peer, Rig, io_path

from pnfarm.protocols.enip.originator import Originator
from pnfarm.protocols.enip.originator_events import ConnectionMade, ConnectionNotMade, SessionRegistered
from pnfarm.protocols.enip.status import Service
from pnfarm.protocols.enip.wire.epath import logical_path
from pnfarm.protocols.enip.wire.message import message_request
from pnfarm.table.channel import RUN, W_START
from pnfarm.wire.endpoint import StreamEnd

__all__ = ["CipLine", "Peer", "Rig", "Scanner", "io_path"]

FARM = """
farm: cip
link: {{kind: memory}}
drives:
  - {{name: 'axis-{{n:02}}', count: {drives}, model: akd-ethernetip, ip: 10.77.0.11/23{more}}}
"""
ENABLE, FAULT, ENABLED = 0x80, 0x08, 0x80
PARAMETER = 0x0F
LOOK_NS = 10_000_000
PATIENCE_NS = 2_000_000_000
PAUSE_NS = 300_000_000


class Scanner(Peer):
    """One drive's: ``losses`` counts connections that were there and are not."""

    def __init__(self, rig: Rig, target: str, number: int) -> None:
        super().__init__(rig, IPv4Interface((int(OWN.ip) + number, 23)), number)
        self.target = IPv4Address(target)
        self.plan = SimpleNamespace(name=f"axis-{number + 1:02}")
        self.unusable: dict[str, int] = {}
        self.losses = self.made = 0
        self.phase = "idle"
        self.until = 0
        self.look_ns = 0
        self.serial = 0
        self.acknowledge_ns = 0
        (self.clear_faults, *_) = next(s for s in rig.farm.axes if s.station.config.ip.ip == self.target).model.resolve(
            "DRV.CLRFAULTS"
        )

    @property
    def consumer(self) -> Any:
        return self.columns.cpm[self.rows[self.serial][1]]

    @property
    def connected(self) -> bool:
        return self.phase == "running" and self.consumer.state == RUN

    @property
    def running(self) -> bool:
        return self.connected and bool(self.response[0] & ENABLED) and not self.response[0] & FAULT

    def next_deadline(self) -> int | None:
        return self.look_ns

    def socket_event(self, event: Any, now: int) -> None:
        if event.stream != self.stream:
            return
        super().socket_event(event, now)
        if event.stream in self.closed:
            self.stream = None

    def service(self, now: int) -> None:
        super().service(now)
        if now < self.look_ns:
            return
        self.look_ns = now + LOOK_NS
        getattr(self, f"_{self.phase}")(now)

    def _go(self, phase: str, now: int, within: int = PATIENCE_NS) -> None:
        self.phase, self.until = phase, now + within

    def _idle(self, now: int) -> None:
        if now < self.until:
            return
        self.originator, self.notes, self.closed = Originator(), [], []
        self.stream = self.link.sockets.connect(self.port.index, (self.target, 44818))
        self._go("registering", now)

    def _registering(self, now: int) -> None:
        if any(isinstance(note, SessionRegistered) for note in self.notes):
            asked = self.asked()
            self.serial = asked.triad.serial
            self.asking = self.originator.forward_open(asked, now)
            self.pump()
            self._go("opening", now)
        elif self.stream is None or now >= self.until:
            self._give_up(now)

    def _opening(self, now: int) -> None:
        for note in self.notes:
            if isinstance(note, ConnectionMade) and note.number == self.asking:
                self.notes = []
                self.command(b"")
                self._exchange(note)
                self.made += 1
                self._go("running", now)
                return
            if isinstance(note, ConnectionNotMade) and note.number == self.asking:
                self._give_up(now)
                return
        if self.stream is None or now >= self.until:
            self._give_up(now)

    def _running(self, now: int) -> None:
        state = int(self.consumer.state)
        if state == W_START or (state != RUN and now >= self.until):
            self.losses += 1
            self.silence(self.serial)
            self._give_up(now)
            return
        self.notes = []
        if self.response[0] & FAULT:
            self.command(b"")
            if now >= self.acknowledge_ns and self.stream is not None:
                self.acknowledge_ns = now + 500_000_000
                path = logical_path(PARAMETER, self.clear_faults.pnu, 1)
                self.originator.request(message_request(Service.SET_ATTRIBUTE_SINGLE, path, b"\1"), now)
                self.pump()
            elif self.stream is None:
                # nothing but messages clears faults
                self.silence(self.serial)
                self._give_up(now)
        else:
            self.command(bytes([ENABLE]))

    def _give_up(self, now: int) -> None:
        if self.stream is not None:
            self.link.sockets.act(self.port.index, StreamEnd(self.stream))
            self.stream = None
        self._go("idle", now, PAUSE_NS)

    @property
    def received_frames(self) -> int:
        return int(self.consumer.received)


class CipLine:
    """``add`` a fault by its fields, ``run``, look; ``plc.sessions`` are the scanners."""

    def __init__(self, drives: int = 1, *, more: str = "") -> None:
        self.rig = Rig(FARM.format(drives=drives, more=more), peers=0)
        self.world, self.farm = self.rig.world, self.rig.farm
        self.faults = self.farm.injections
        self.scanners = [Scanner(self.rig, f"10.77.0.{11 + n}", n) for n in range(drives)]
        self.rig.peers, self.rig.peer = self.scanners, self.scanners[0]
        self.plc = self

    @property
    def sessions(self) -> list[Scanner]:
        return self.scanners

    @property
    def all_connected(self) -> bool:
        return all(scanner.connected for scanner in self.scanners)

    @property
    def all_running(self) -> bool:
        return all(scanner.running for scanner in self.scanners)

    def connect(self, within: float = 20.0) -> None:
        assert self.until(lambda: self.all_connected, within), self.reasons()

    def enable(self, within: float = 20.0) -> None:
        assert self.until(lambda: self.all_running, within), self.reasons()

    def run(self, seconds: float) -> None:
        self.world.run(seconds)

    def until(self, condition: Any, within: float = 5.0) -> bool:
        return self.world.run(within, until=condition)

    def add(self, kind: str, on: object = "all", **fields: Any) -> Any:
        renamed = {key.rstrip("_"): value for key, value in fields.items()}
        return self.faults.inject({"kind": kind, "on": on, **renamed}, self.world.now)

    def clear(self, fault_id: str | None = None) -> Any:
        return self.faults.clear(fault_id, self.world.now)

    def reasons(self) -> list[Any]:
        return [(s.plan.name, s.phase, s.response[:2].hex(), self.events(s.plan.name)[-6:]) for s in self.scanners]

    def events(self, name: str) -> list[str]:
        return [entry.event for entry in self.farm.log.entries(name)]
