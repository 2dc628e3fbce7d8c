"""Further machines that are fuzzed: the reading of captures, and submodules that come and go while calls arrive."""

from __future__ import annotations

import gzip
import json
import struct
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from uuid import UUID

from cip_tape import everything

from pnfarm.buses.imports import ImportingBus
from pnfarm.buses.profinet.device.modules import modules_view, plug_module, pull_module
from pnfarm.buses.registry import BUSES
from pnfarm.buses.registry import decoder as make_decoder
from pnfarm.captures.reading import CapturedFrame, FrameReader
from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.diagnosis import DiagnosisEntry
from pnfarm.protocols.profinet.rpc.events import CallKey
from pnfarm.protocols.profinet.rpc.fragments import Peer
from pnfarm.protocols.profinet.wire.alarms.notification import AlarmNotification, acknowledge
from pnfarm.protocols.profinet.wire.alarms.rta import RtaPdu
from pnfarm.protocols.profinet.wire.any_block import emit_blocks
from pnfarm.protocols.profinet.wire.block import BlockType
from pnfarm.protocols.profinet.wire.cm.control import ControlBlock, ControlCommand, SubmoduleList
from pnfarm.protocols.profinet.wire.frame_id import ALARM_HIGH, ALARM_LOW
from tests.fuzz.machines import PEER, Machine
from tests.fuzz.malformed import deep
from tests.fuzz.mutate import mutated
from tests.fuzz.watch import holdings

__all__ = ["MORE"]

#: Submodules of an AKD: api, slot, subslot.
KEYS = ((0, 0, 1), (0, 0, 0x8000), (0, 0, 0x8001), (0x3A00, 1, 1), (0x3A00, 1, 2))
#: What a decoder may hold of a capture, in entries of containers.
DECODER_ENTRIES = 200_000
#: Octets of the headers of Ethernet and IPv4.
BEHIND_IPV4 = 34


class DecoderMachine(Machine):
    """Frames of a capture, whole and broken; what they are worth must be plain JSON."""

    name = "decoder"

    def start(self, rng):
        self.decoder = make_decoder(every_frame=rng.random() < 0.5)
        self.observing = [bus for bus in BUSES.values() if isinstance(bus, ImportingBus)]
        for bus in self.observing:
            bus.observe(self.decoder.buses[bus.name])
        self.number = self.lines = 0
        self.time = 10**18

    def revive(self, rng):
        self.time += rng.choice((1, 10**6, 10**9, -(10**9)))
        entries, _ = holdings(self.decoder)
        assert entries < DECODER_ENTRIES, f"the decoder holds {entries} entries"
        for bus in self.observing:
            for found in bus.found(self.decoder.buses[bus.name], models=rng.random() < 0.5):
                assert found.name

    def next_input(self, rng):
        frame = rng.choice(self.layers["frame"])
        return frame if rng.random() < 0.2 else deep(rng, frame, self.layers["frame"])

    def take(self, rng, data):
        self.number += 1
        self.time += rng.choice((0, 1000, 10**6, 4 * 10**6))
        cut = rng.choice((0, 0, 0, 10))
        frame = CapturedFrame(
            self.number, self.time, data, rng.choice((None, "axis-01")), rng.choice((None, 1, 2)), cut
        )
        for line in self.decoder.feed(frame):
            json.dumps(self.decoder.as_dict(line))
            assert isinstance(f"{self.decoder.name(line.source)} {line.description.what} {line.description.text}", str)
            self.lines += 1

    def said(self):
        return self.lines


class EnipDecoderMachine(DecoderMachine):
    """Frames of EtherNet/IP: what is behind the IPv4 header is changed, and frames come in any order."""

    name = "enip-decoder"

    def start(self, rng):
        super().start(rng)
        self.frames = everything()
        self.inside = [frame[BEHIND_IPV4:] for frame in self.frames]

    def next_input(self, rng):
        frame = rng.choice(self.frames)
        if rng.random() < 0.3:
            return frame
        return frame[:BEHIND_IPV4] + mutated(rng, frame[BEHIND_IPV4:], self.inside)


class CaptureFileMachine(Machine):
    """Files that are captures nearly: pcap and pcapng, packed and plain. A reader's error is a ConfigError."""

    name = "capture-file"

    def start(self, rng):
        self.frames = 0
        self.folder = TemporaryDirectory(prefix="pnfarm-fuzz-")
        self.path = Path(self.folder.name) / "capture.pcap"
        frames = [rng.choice(self.layers["frame"]) for _ in range(3)]
        self.files = [_pcap(frames, order) for order in "<>"] + [_pcapng(frames, order) for order in "<>"]
        self.files += [gzip.compress(file, mtime=0) for file in self.files]

    def revive(self, rng):
        """A file has no time."""

    def next_input(self, rng):
        return mutated(rng, rng.choice(self.files), self.files)

    def take(self, rng, data):
        del rng
        try:
            self.path.write_bytes(data)
            reader = FrameReader(self.path)
            for frame in reader:
                assert len(frame.data) <= 1 << 22
                self.frames += 1
        except ConfigError:
            pass  # what a reader may say
        finally:
            self.path.unlink()

    def said(self):
        return self.frames


def _pcap(frames, order):
    head = struct.pack(order + "IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    return head + b"".join(struct.pack(order + "IIII", 1, 2, len(f), len(f)) + f for f in frames)


def _pcapng(frames, order):
    def block(kind, body):
        body += bytes(-len(body) % 4)
        length = struct.pack(order + "I", len(body) + 12)
        return struct.pack(order + "I", kind) + length + body + length

    section = block(0x0A0D0D0A, struct.pack(order + "IHHq", 0x1A2B3C4D, 1, 0, -1))
    interface = block(1, struct.pack(order + "HHI", 1, 0, 0) + struct.pack(order + "HH", 2, 4) + b"eth0" + bytes(4))
    packets = (block(6, struct.pack(order + "IIIII", 0, 0, 5, len(f), len(f)) + f) for f in frames)
    return section + interface + b"".join(packets)


class SubmodulesMachine(Machine):
    """Modules that are pulled and plugged, diagnosis that comes and goes, PrmBegin and PrmEnd.plug, in any order.

    An input is the octets of a Control call or of an alarm frame; what happens to the modules is drawn beside it.
    """

    name = "cm-submodules"
    COMMANDS = (
        (BlockType.PRM_BEGIN_REQ, ControlCommand.PRM_BEGIN),
        (BlockType.PRM_END_REQ, ControlCommand.PRM_END),
        (BlockType.PRM_END_PLUG_REQ, ControlCommand.PRM_END),
    )

    def next_input(self, rng):
        ar = next((ar for ar in self.station.device.cm.ars if ar.alarm_cr is not None), None)
        if ar is None:
            return b"\x04"
        kind = rng.choice((0, 0, 1))
        if kind:
            return b"\xff" + self._acknowledgement(rng, ar)
        block_type, command = rng.choice(self.COMMANDS)
        block = ControlBlock(
            block_type, ar.uuid, ar.request.session_key, command, rng.choice((0, 1, 2, 3, rng.getrandbits(16)))
        )
        entries = tuple(rng.choice((*KEYS, (1, 2, 3))) for _ in range(rng.randrange(4)))
        extra = (SubmoduleList(entries),) if rng.random() < 0.5 else ()
        octets = emit_blocks((block, *extra))
        return b"\x04" + (octets if rng.random() < 0.6 else mutated(rng, octets, [octets]))

    def _acknowledgement(self, rng, ar):
        high = rng.random() < 0.5
        api, slot, subslot = rng.choice(KEYS)
        alarm = AlarmNotification(rng.choice((3, 4, 9, 0xB)), api, slot, subslot, specifier=rng.randrange(8), high=high)
        body = acknowledge(alarm).emit()
        numbers = (0xFFFF, 0xFFFE, 0, 1, 2)
        pdu = RtaPdu(
            ALARM_HIGH if high else ALARM_LOW, ar.local_alarm_reference, ar.alarm_cr.local_alarm_reference,
            0x10 | rng.choice((1, 2, 3)), 0x11, rng.choice(numbers), rng.choice(numbers), body,
        )  # fmt: skip
        octets = (replace(pdu, body=b"") if pdu.type != 1 else pdu).emit()
        return octets if rng.random() < 0.7 else mutated(rng, octets, self.layers["rta"])

    def take(self, rng, data):
        station, cm = self.station, self.station.device.cm
        for _ in range(rng.randrange(3)):
            self._move(rng, station)
        self.calls += 1
        if data[0] == 0xFF:
            cm.receive_rta(data[1:], self.line.plc.port.mac, self.now)
        else:
            cm.receive_call(
                CallKey(PEER, UUID(int=self.calls), 0), data[0], data[1:], 4096, Peer(PEER, 49153), self.now
            )
            self.answers += sum(status.ok for _, status, _ in cm.responses())
        self.settle()
        json.dumps(modules_view(station.device))

    def _move(self, rng, station):
        try:
            match rng.randrange(6):
                case 0:
                    pull_module(station.device, 1, rng.choice((None, 1, 2)), self.now)
                case 1:
                    plug_module(station.device, 1, self.now)
                case 2:
                    plug_module(
                        station.device, 1, self.now, ident=rng.choice((1, 0x7777)), substitute=rng.random() < 0.5
                    )
                case 3:
                    entry = DiagnosisEntry(*rng.choice(KEYS), error_type=rng.randrange(1, 0x100))
                    rng.choice((station.device.cm.diagnosis.add, station.device.cm.diagnosis.remove))(entry)
                case 4:
                    station.device.cm.alarm(rng.randrange(1, 32), rng.choice(KEYS), self.now, high=rng.random() < 0.5)
                case _:
                    self.line.run(rng.choice((0.001, 0.1)))
        except ConfigError:
            pass  # the slot is empty, or holds it already

    def revive(self, rng):
        """With its module in place again, a connection must come up."""
        self.station.device.cm.plugged.plug(1, self.station.device.description.default_module(1))
        super().revive(rng)


MORE: tuple[type[Machine], ...] = (DecoderMachine, EnipDecoderMachine, CaptureFileMachine, SubmodulesMachine)
