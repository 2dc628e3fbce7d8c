"""``python -m tests.fuzz --running``: a farm and its controller at work, and a hostile third station between them.

An *episode* is a fresh farm that takes some ten thousand shots, as a stranger's or as an impostor's; a seed and an
episode's number make the same one again. An honest fourth station asks its questions all the while.

Which inputs are worth keeping is told by what they cause: an answer, a reason of discard or a log entry that was not
seen before. A line tracer would tell more and cost more than all the rest of an input.
"""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import argparse
import gc
import sys
import time
import traceback
from collections import Counter, deque
from collections.abc import Iterator
from ipaddress import IPv4Interface
from random import Random
from typing import NoReturn
from zlib import crc32

from bystander import Bystander
from virtual_line import VirtualLine

from pnfarm.buses.profinet.controller.session import SessionState
from pnfarm.engine.tick import receive
from pnfarm.protocols.profinet.dcp.client import IdentifyAnswered
from pnfarm.protocols.profinet.wire.records.iod import parse_read_response
from pnfarm.protocols.profinet.wire.rpc.pdu import UUID_PNIO_CONTROLLER, Opnum
from pnfarm.protocols.profinet.wire.snmp.message import (
    GET_NEXT,
    VERSION_1,
    Pdu,
    SnmpMessage,
    VarBind,
    emit_snmp,
    parse_snmp,
)
from pnfarm.table.channel import FRAME_SLOT
from tests.fuzz.corpus import Corpus, gather
from tests.fuzz.hostile import Attacker, Prey, Shot, signature
from tests.fuzz.watch import FailureFoundError, Memory, Monotonic, look_at_snapshots, resident

__all__ = ["Episode", "main"]

#: Processor time of one shot and of what follows from it.
SHOT_SECONDS = 1.0
#: Shots between two looks at the tables, and between two rests in which everything is checked.
LOOK, REST = 250, 2000
#: A rest is longer than what DCP and RPC make one client wait for another: 3 s and 5 s.
REST_SECONDS = 8.0
#: A connection must come back within this time of peace: a Connect that was left open is forgotten after 100 s at most.
RETURN_SECONDS = 240.0
#: What the process may grow in an episode's second half: logs and kept inputs fill up, and the allocator keeps pages.
SLACK = 24 * 1024 * 1024
#: The other models, and the telegram that each is run with.
MODELS = {"hiwin-e1": 3, "moog-msd": 1}
SYSTEM = (1, 3, 6, 1, 2, 1, 1)


class Honest(Bystander):
    """An engineering tool that asks one question after the other; wrong answers are findings."""

    def __init__(self, line: VirtualLine, rng: Random) -> None:
        super().__init__(line.world, "tool", bytes.fromhex("020000777701"), IPv4Interface("10.77.1.77/23"))
        self.line = line
        self.rng = rng
        self.done: Counter[str] = Counter()
        self._open: tuple[int, int] | None = None
        self.names = {station.port.mac: station.device.name for station in line.farm.axes}
        self.im0 = {station.index: self.read_without(station, 0xAFF0) for station in line.farm.axes}

    def work(self) -> None:
        """Take an answer that has come, or begin the next question."""
        self.service()
        if self._open is not None:
            call, index = self._open
            if call not in self.answers:
                return
            answer = self.answers.pop(call)
            self._open = None
            if answer.status == 0:
                self._compare(index, parse_read_response(answer.payload).data)
            self.done[
                "read answered" if answer.status == 0 else f"read failed: {answer.reason or hex(answer.status)}"
            ] += 1
            return
        station = self.rng.choice(self.line.farm.axes)
        match self.rng.randrange(3):
            case 0:
                self.dcp.identify(now=self.now, window_ns=10**8)
                self.settle()
                self.done["identify asked"] += 1
            case 1:
                self.ask_snmp(station, _get_next((*SYSTEM, self.rng.randrange(8))))
                self.done["snmp asked"] += 1
            case _:
                if station.device.ip.address is not None:
                    self._open = self.call(station, Opnum.READ_IMPLICIT, self.implicit_read(0xAFF0)), station.index

    def _compare(self, index: int, data: bytes) -> None:
        wanted = self.im0[index]
        # the revision counter, octets 46 and 47 of the block, counts what was written
        if wanted is None or data[:46] != wanted[:46]:
            raise FailureFoundError(f"I&M0 of drive {index} reads {data.hex()}")

    def round(self) -> None:
        """Without attacks everything is answered: each drive by DCP, by RPC and by SNMP."""
        line = self.line
        if self._open is not None:
            call, _ = self._open
            self.run(15, until=lambda: call in self.answers)
            self.work()
        self.dcp_events.clear()
        xid = self.dcp.identify(now=self.now, window_ns=10**8)
        self.run(0.5)
        answers = [event for event in self.dcp_events if isinstance(event, IdentifyAnswered) and event.xid == xid]
        found = {answer.mac: answer.info.name for answer in answers}
        found.pop(line.plc.port.mac, None)
        if found != self.names:
            raise FailureFoundError(f"DCP finds {found}")
        for station in line.farm.axes:
            answer = self.called(station, Opnum.READ_IMPLICIT, self.implicit_read(0xAFF0))
            if answer.status != 0:
                raise FailureFoundError(f"{station.configured_name} does not let I&M0 be read: {answer}")
            self._compare(station.index, parse_read_response(answer.payload).data)
            self._walk(station)
        self.done["rounds"] += 1

    def _walk(self, station):
        """The agent's whole tree, by GetNext; it must end."""
        name, rows = (1, 0), 0
        while True:
            self.datagrams.clear()
            self.ask_snmp(station, _get_next(name))
            if not self.run(2, until=lambda: bool(self.datagrams)):
                raise FailureFoundError(f"{station.configured_name} does not answer SNMP after {name}")
            answer = parse_snmp(self.datagrams.popleft()).pdu
            if answer.error_status:
                break
            following = answer.varbinds[0].name
            if following <= name:
                raise FailureFoundError(f"SNMP goes from {name} to {following}")
            name, rows = following, rows + 1
            if rows > 2000:
                raise FailureFoundError(f"the SNMP tree of {station.configured_name} does not end")
        self.done["snmp objects walked"] += rows


def _get_next(name: tuple[int, ...]) -> bytes:
    return emit_snmp(SnmpMessage(VERSION_1, b"public", Pdu(GET_NEXT, 7, varbinds=(VarBind(name),))))


class Episode:
    """One farm under attack."""

    def __init__(self, corpus: Corpus, seed: str, drives: int, *, impostor: bool) -> None:
        self.rng = Random(seed)
        self.impostor = impostor
        startup = self.rng.choice(("legacy", "advanced"))
        #: Mostly the model of the corpus; the others have other slots, telegrams and habits.
        self.model = self.rng.choice(("akd-profinet", "akd-profinet", *MODELS))
        telegram = MODELS.get(self.model, 1)
        self.line = VirtualLine(
            drives, cycle="4ms", limits="lax", watchdog=16, startup=startup, model=self.model, telegram=telegram
        )
        self.line.enable(20)
        self.line.run(1)
        self.honest = Honest(self.line, Random(seed + "/honest"))
        plc = self.line.plc
        self.preys = [self._drive(index) for index in range(drives)]
        self.controller = Prey(
            "plc", plc.port.mac, plc.ip.address.ip, UUID_PNIO_CONTROLLER, False,
            lambda: [s.ar_uuid for s in plc.sessions if s.ar_uuid is not None], lambda: (1, 1),
            lambda: self._sent_by(self.line.farm, self.line.farm.axes[0].device),
        )  # fmt: skip
        self.attacker = Attacker(self.rng, corpus, self.preys, self.controller, impostor=impostor)
        switch = self.line.world.switch
        self.port = switch.attach(self.attacker.mac, self._heard, name="hostile")
        self.shots = self.digest = 0
        self.kinds: Counter[str] = Counter()
        self.novel: set[object] = set()
        self._answers: list[object] = []
        self.last: deque[str] = deque(maxlen=12)
        self.longest_ns = self.total_ns = 0
        self.line.log.subscribe(lambda entry: self._answers.append((entry.event, str(entry.data.get("reason", "")))))
        self.line.plc_log.subscribe(lambda entry: self._answers.append((entry.event, "plc")))
        self.monotonic, self.memory = Monotonic(self.line), Memory(self.line)
        self._begin = self._cyclic_state()

    def _drive(self, index: int) -> Prey:
        station = self.line.farm.axes[index]

        def references():
            ar = next((ar for ar in station.device.cm.ars if ar.alarm_cr is not None), None)
            return (1, 1) if ar is None else (ar.local_alarm_reference, ar.alarm_cr.local_alarm_reference)

        device = station.device
        return Prey(
            device.name, station.port.mac, station.station.config.ip.ip,
            device.rpc.config.endpoints[0].object_uuid, True,
            lambda: [ar.uuid for ar in self.line.farm.axes[index].device.cm.ars], references,
            lambda: self._sent_by(self.line.plc, self.line.plc.sessions[index]),
        )  # fmt: skip

    @staticmethod
    def _sent_by(node, who) -> bytes:
        """The frame that a session or a station sends now."""
        if hasattr(who, "provider"):
            row = who.provider
        else:
            row = next((r for ar in who.ars.values() for r, _ in ar.providers), None)
        return b"" if row is None else node.columns.frames[row, : int(node.columns.ppm[row].length)].tobytes()

    def _heard(self, _port, frame, _now):
        if len(self._answers) < 1000:
            self._answers.append(signature(frame))

    # -- shots -------------------------------------------------------------------------------------------------------

    def shoot(self) -> None:
        shot = self.attacker.next_shot()
        self.last.append(str(shot))
        self.digest = crc32(self.last[-1].encode(), self.digest)
        self._answers.clear()
        prey = shot.prey
        station = self.line.farm.axes[self.preys.index(prey)] if prey.is_drive else None
        dropped = station.device.discards() if station is not None else dict(self.line.plc.dropped)
        start = time.thread_time_ns()
        self._fire(shot)
        self.line.run(self.rng.choice((0, 0, 0, 0, 1e-6, 1e-4, 1e-3, 1e-2)))
        took = time.thread_time_ns() - start
        self.longest_ns, self.total_ns = max(self.longest_ns, took), self.total_ns + took
        if took > SHOT_SECONDS * 1e9:
            raise FailureFoundError(f"took {took / 1e9:.3f} s of processor time")
        now = station.device.discards() if station is not None else self.line.plc.dropped
        met = {("drop", prey.is_drive, reason) for reason, count in now.items() if dropped.get(reason, 0) != count}
        met |= {(prey.is_drive, answer) for answer in self._answers}
        if not met <= self.novel:
            self.novel |= met
            self.attacker.keep(shot)
        self.shots += 1
        self.kinds[shot.kind] += 1

    def _fire(self, shot: Shot) -> None:
        world = self.line.world
        for frame in shot.frames:
            world.switch.send(self.port.index, frame, world.now)
        node = self.line.farm if shot.prey.is_drive else self.line.plc
        columns = node.columns
        stations = {station.port.mac: station.port for station in self.line.farm.axes}
        port = stations.get(shot.prey.mac, self.line.plc.port).index
        for count, frame in enumerate(shot.cyclic):
            octets = frame[:FRAME_SLOT]
            columns.rx_frames[count, : len(octets)] = list(octets)
            columns.rx_length[count] = len(frame)
            columns.rx_port[count] = port
            columns.rx_ns[count] = world.now
        if shot.cyclic:
            receive(columns, len(shot.cyclic))

    def go(self, count: int, stop) -> None:
        for _ in range(count):
            self.shoot()
            if self.shots % 20 == 0:
                self.line.run(self.rng.choice((0.001, 0.004, 0.02)))
                self.honest.work()
            if self.shots % LOOK == 0:
                self.memory.look()
                if not self.impostor:
                    self.undisturbed()
            if self.shots % REST == 0:
                self.rest()
                if stop():
                    return

    # -- what must hold ----------------------------------------------------------------------------------------------

    def _cyclic_state(self):
        plc = self.line.plc
        return [(s.ar_uuid, s.measures.connects, s.measures.losses) for s in plc.sessions]

    def undisturbed(self) -> None:
        """No connection ended, no axis stopped, no cyclic frame of the controller's was lost."""
        plc, farm = self.line.plc, self.line.farm
        if self._cyclic_state() != self._begin or not plc.all_connected:
            raise FailureFoundError(f"a stranger ended a connection: {self.line.reasons()}")
        if not plc.all_running:
            raise FailureFoundError("a stranger stopped an axis")
        for session, station in zip(plc.sessions, farm.axes, strict=True):
            uuid = session.ar_uuid
            ar = next((ar for ar in station.device.cm.ars if ar.uuid == uuid), None)
            if ar is None or session.state is not SessionState.DATA:
                raise FailureFoundError(f"{station.configured_name} has lost its controller's AR")
            if ar.locked or ar.pending:
                raise FailureFoundError(
                    f"{station.configured_name}: the controller lost submodules {ar.locked} {ar.pending}"
                )
            consumer = farm.columns.cpm[station.device.ars[ar.key].consumers[0][0]]
            sent = int(plc.columns.ppm[session.provider].sent)
            if not 0 <= sent - int(consumer.received) <= 2:
                raise FailureFoundError(f"{station.configured_name} took {int(consumer.received)} of {sent} frames")
            provider = farm.columns.ppm[station.device.ars[ar.key].providers[0][0]]
            taken = int(plc.columns.cpm[session.consumer].received)
            if not 0 <= int(provider.sent) - taken <= 2:
                raise FailureFoundError(f"the controller took {taken} of {int(provider.sent)} frames")
            # a drive's own count has those of the stranger's connections too
            if session.measures.expirations:
                raise FailureFoundError("a data hold timer ran out")

    def rest(self) -> None:
        """Peace: what was disturbed comes back, everybody answers, nothing is held."""
        if self.impostor:
            self._repair()
        self.honest.run(REST_SECONDS)
        if not self.impostor:
            self.undisturbed()
        self.honest.round()
        self.monotonic.look()
        look_at_snapshots(self.line, list(self.honest.names.values()))
        self.memory.mark(self.shots)

    def _repair(self):
        """Names and addresses as the farm file has them, then time for the connections to come back."""
        world, line = self.line.world, self.line
        self.honest.run(4)
        for station in line.farm.axes:
            if station.device.name != station.configured_name:
                self.honest.dcp.set_name(station.port.mac, station.configured_name, now=world.now)
                self.honest.run(5)
        if not self.honest.run(RETURN_SECONDS, until=self._back):
            addresses = {station.configured_name: str(station.device.ip.address) for station in line.farm.axes}
            raise FailureFoundError(f"a connection did not come back: {line.reasons()}; {addresses}")

    def _back(self) -> bool:
        """Every connection is open; an address that was refused for a conflict's sake is in use again."""
        line = self.line
        addresses = all(
            s.device.ip.address is not None and s.device.ip.address.ip == s.station.config.ip.ip for s in line.farm.axes
        )
        return addresses and line.plc.all_connected


class Running:
    """Episodes until the time is up."""

    def __init__(self, options: argparse.Namespace) -> None:
        self.options = options
        self.began = self.reported = time.monotonic()
        self.total = Counter()
        self.honest: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()

    def out_of_time(self) -> bool:
        return time.monotonic() - self.began > self.options.minutes * 60

    def go(self) -> None:
        options = self.options
        corpus = gather()
        first = options.episode if options.episode is not None else 0
        number = first
        print(f"{sum(map(len, corpus.layers.values()))} octet strings to start from; seed {options.seed}", flush=True)
        while True:
            self.episode(corpus, number)
            number += 1
            gc.collect()
            if options.episode is not None or self.out_of_time():
                return

    def episode(self, corpus: Corpus, number: int) -> None:
        options = self.options
        impostor = number % 2 == 1 if options.mode == "both" else options.mode == "impostor"
        episode = Episode(corpus, f"{options.seed}/running/{number}", options.drives, impostor=impostor)
        start, virtual = time.monotonic(), episode.line.world.now
        try:
            episode.go(options.shots, lambda: options.episode is None and self.out_of_time())
            episode.memory.check(SLACK)
        except Exception as exc:  # noqa: BLE001 - whatever it is, it is the finding
            self.failed(episode, number, exc)
        seconds = time.monotonic() - start
        losses = sum(s.measures.losses for s in episode.line.plc.sessions)
        for line in _told(episode, number, seconds, (episode.line.world.now - virtual) / 1e9, losses):
            print(line, flush=True)
        self.kinds += episode.kinds
        self.honest += episode.honest.done
        self.total["shots"] += episode.shots
        self.total["losses"] += losses

    def failed(self, episode: Episode, number: int, exc: Exception) -> NoReturn:
        print(f"\nepisode {number} failed at shot {episode.shots} (seed {self.options.seed}):", file=sys.stderr)
        traceback.print_exception(exc, file=sys.stderr)
        print("the last shots:", *episode.last, sep="\n  ", file=sys.stderr)
        names = [entry.as_dict() for entry in episode.line.log.entries()[-12:]]
        print("the last of the log:", *names, sep="\n  ", file=sys.stderr)
        again = (
            f"python -m tests.fuzz --running --seed {self.options.seed} --drives {self.options.drives}"
            f" --mode {self.options.mode} --episode {number} --shots {episode.shots + REST}"
        )
        print(f"again: {again}", file=sys.stderr)
        raise FailureFoundError(f"episode {number}") from exc

    def table(self) -> None:
        seconds = time.monotonic() - self.began
        print(f"\nby kind: {dict(self.kinds.most_common())}\nhonest: {dict(self.honest)}")
        print(
            f"{self.total['shots']} shots at a running farm in {seconds:.0f} s; {resident() >> 20} MiB;"
            f" no connection disturbed by a stranger, {self.total['losses']} ended by an impostor and back"
        )


def _told(episode: Episode, number: int, seconds: float, virtual: float, losses: int) -> Iterator[str]:
    """What one episode has to say for itself."""
    memory, who = episode.memory, "impostor" if episode.impostor else "stranger"
    rate = episode.shots / max(1e-9, seconds)
    yield (
        f"episode {number}, {who}, {episode.model}: {episode.shots} shots in {seconds:.0f} s ({rate:,.0f} a second),"
        f" {virtual:.0f} s of the farm's time, {len(episode.novel)} kinds of answers,"
        f" digest {episode.digest:08x}; {losses} connections lost and back"
    )
    mean = episode.total_ns / max(1, episode.shots) / 1e3
    curve = ", ".join(f"{n // 1000}k {octets >> 20}" for n, octets in _thinned(memory.curve))
    yield (
        f"  mean {mean:.0f} us, longest {episode.longest_ns / 1e6:.0f} ms; held at most {memory.most_entries} entries"
        f" ({memory.largest}) and {memory.most_octets >> 10} KiB; MiB resident: {curve}"
    )
    yield f"  honest: {dict(episode.honest.done)}"


def _thinned(curve: list[tuple[int, int]]) -> list[tuple[int, int]]:
    step = max(1, len(curve) // 8)
    return curve[::step]


def main(options: argparse.Namespace) -> int:
    run = Running(options)
    try:
        run.go()
    except FailureFoundError as exc:
        print(f"failed: {exc}", file=sys.stderr)
        return 1
    run.table()
    return 0
