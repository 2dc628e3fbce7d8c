"""CIP's class 1 in the engine: what an originator and a target exchange, octet for octet."""

from __future__ import annotations

import struct
from ipaddress import IPv4Address

import numpy as np
import pytest
from wireshark import tshark_fields

from pnfarm.engine.channels import class1
from pnfarm.engine.channels.class1_plan import Class1ConsumerPlan, Class1ProviderPlan
from pnfarm.engine.channels.impairments import ImpairmentTable
from pnfarm.engine.channels.schedule import ChannelTable
from pnfarm.engine.columns import CHANGED_AT, RX_BATCH, allocate
from pnfarm.engine.tick import next_due, receive, tick
from pnfarm.engine.virtual import run_virtual
from pnfarm.errors import InternalError
from pnfarm.table import engine_row
from pnfarm.table.channel import (
    DISCARD_CHECKSUM,
    DISCARD_COUNTER,
    DISCARD_IMPAIRED,
    DISCARD_LENGTH,
    DISCARD_SOURCE,
    FRAME_SLOT,
    STATUS_GOOD,
    STATUS_RUN,
)
from pnfarm.table.compiling.compiled import IS_COMPILED
from pnfarm.table.image import LOST_EXPIRED, LOST_STOP
from pnfarm.table.impairment import CORRUPT, COUNTER_FREEZE, FRAME_ID, LENGTH, LOSS, PROVIDER_STOP
from pnfarm.table.signals import PART_HIGH, PART_LOW, word_code
from pnfarm.wire.ipv4 import parse_ipv4
from pnfarm.wire.mac import multicast_mac
from pnfarm.wire.udp import ChecksumState, parse_udp, udp_checksum

MS = 1_000_000
RPI = 10 * MS
DRIVE, SCANNER = bytes.fromhex("020000000b0b"), bytes.fromhex("020000000cfa")
DRIVE_IP, SCANNER_IP = IPv4Address("10.77.0.11"), IPv4Address("10.77.1.250")
O_TO_T, T_TO_O = 0x8BADF00D, 0x12345678
FIRST = 16
#: Sixteen double words, the low part of each first.
WORDS = [
    (word_code(FIRST + n, part), 4 * n + place) for n in range(16) for part, place in ((PART_LOW, 0), (PART_HIGH, 2))
]


class Line:
    """A target (``drive``) and an originator (``scanner``) with one connection, 64 octets each way."""

    def __init__(self, rpi: int = RPI, multiplier: int = 4, first_hold_ns: int | None = None, **of_target) -> None:
        self.drive, self.scanner = (allocate(images=1, channels=4, impairments=4) for _ in range(2))
        self.drive_rows, self.scanner_rows = ChannelTable(self.drive), ChannelTable(self.scanner)
        common = {"image": 0, "port": 7, "data_length": 64, "rpi_ns": rpi, "words": WORDS}
        mine = {"destination": SCANNER, "destination_address": SCANNER_IP, **of_target}
        self.drive_rows.open_provider(
            Class1ProviderPlan(source=DRIVE, source_address=DRIVE_IP, connection_id=T_TO_O, **mine, **common)
        )
        self.drive_rows.open_consumer(
            Class1ConsumerPlan(
                destination=DRIVE, destination_address=DRIVE_IP, source_address=SCANNER_IP, connection_id=O_TO_T,
                multiplier=multiplier, run_idle=True, first_hold_ns=first_hold_ns, **common,
            )
        )  # fmt: skip
        self.scanner_rows.open_provider(
            Class1ProviderPlan(
                destination=DRIVE, source=SCANNER, destination_address=DRIVE_IP, source_address=SCANNER_IP,
                connection_id=O_TO_T, run_idle=True, tos=0xBC, **common,
            )
        )  # fmt: skip
        self.scanner_rows.open_consumer(
            Class1ConsumerPlan(
                destination=mine["destination"], destination_address=mine["destination_address"],
                source_address=DRIVE_IP, connection_id=T_TO_O, multiplier=multiplier, **common,
            )
        )  # fmt: skip
        self.now = 1_000 * MS
        self.events: list[tuple[str, int, int]] = []
        self._tails = {"drive": 0, "scanner": 0}

    def rest(self) -> None:
        """Ticks only where something is due, and each 50 ms: for long runs."""
        self.drive.engine[0].tick_ns = self.scanner.engine[0].tick_ns = 50 * MS

    def run(self, seconds: float) -> None:
        until = self.now + round(seconds * 1e9)
        drive, scanner = (np.array([int.from_bytes(mac, "big")]) for mac in (DRIVE, self._group()))
        port = np.array([7], np.int32)
        while self.now < until:
            self.now = run_virtual(self.drive, self.scanner, drive, port, scanner, port, self.now, until)
        for side in ("drive", "scanner"):
            columns = getattr(self, side)
            head = int(columns.engine[0].event_head)
            for i in range(self._tails[side], head):
                event = columns.events[i]
                self.events.append((side, int(event.kind), int(event.value)))
            self._tails[side] = head

    def _group(self) -> bytes:
        return int(self.scanner.cpm[0].destination).to_bytes(6, "big")

    def sent(self, side: str) -> bytes:
        """The last frame of one side."""
        columns = getattr(self, side)
        return columns.frames[0, : int(columns.ppm[0].length)].tobytes()

    def give(self, frame: bytes, wait: float = 0.0) -> None:
        """The drive receives a frame."""
        self.now += round(wait * 1e9)
        self.drive.rx_frames[0, : len(frame)] = list(frame)
        self.drive.rx_length[0], self.drive.rx_port[0], self.drive.rx_ns[0] = len(frame), 7, self.now
        receive(self.drive, 1)


def packet(
    sequence: int = 1,
    count: int = 1,
    run: int = 1,
    data: bytes = bytes(64),
    *,
    connection: int = O_TO_T,
    source: IPv4Address = SCANNER_IP,
    destination: IPv4Address = DRIVE_IP,
    checksum: str = "good",
    options: bytes = b"",
    tag: bytes = b"",
    more_items: bytes = b"",
    port: int = 2222,
    padding: bytes = b"",
) -> bytes:
    """An originator's packet, made without the engine."""
    items = struct.pack("<HHHII", 2 + bool(more_items), 0x8002, 8, connection, sequence)
    items += struct.pack("<HHHI", 0x00B1, len(data) + 6, count, run) + data + more_items
    udp = struct.pack(">HHHH", 40000, port, 8 + len(items), 0) + items
    pseudo = source.packed + destination.packed + struct.pack(">BBH", 0, 17, len(udp))
    if checksum != "none":
        total = summed(pseudo if checksum == "unfinished" else pseudo + udp)
        field = total if checksum == "unfinished" else 0xFFFF ^ total
        field ^= 0x0100 if checksum == "bad" else 0
        udp = udp[:6] + struct.pack(">H", field) + udp[8:]
    head = struct.pack(
        ">BBHHHBBH4s4s", 0x45 + len(options) // 4, 0, 20 + len(options) + len(udp), 9, 0x4000, 64, 17, 0,
        source.packed, destination.packed,
    ) + options  # fmt: skip
    head = head[:10] + struct.pack(">H", 0xFFFF ^ summed(head)) + head[12:]
    return DRIVE + SCANNER + tag + b"\x08\x00" + head + udp + padding


def summed(data: bytes) -> int:
    data += bytes(len(data) % 2)
    total = sum(struct.unpack(f">{len(data) // 2}H", data))
    while total >> 16:
        total = (total & 0xFFFF) + (total >> 16)
    return total


def in_words(values: list[int]) -> bytes:
    return struct.pack("<16i", *values)


def test_sixteen_little_endian_double_words_go_each_way():
    line = Line()
    there, back = [n * -0x01020304 - 1 for n in range(16)], [n * 0x04030201 for n in range(16)]
    line.scanner.image[0].sent[FIRST : FIRST + 16] = there
    line.drive.image[0].sent[FIRST : FIRST + 16] = back
    line.run(0.1)
    assert line.drive.image[0].received[FIRST : FIRST + 16].tolist() == there
    assert line.scanner.image[0].received[FIRST : FIRST + 16].tolist() == back
    assert line.drive.image[0].valid
    assert line.sent("drive")[-64:] == in_words(back)
    assert line.scanner_rows.provided(0) == in_words(there) == line.drive_rows.consumed(0)


def test_a_packet_is_an_ipv4_datagram_of_two_items_with_checksums_that_hold():
    line = Line(ttl=3)
    line.run(0.105)
    for side, count, tos, ttl in (("scanner", 10, 0xBC, 64), ("drive", 10, 0, 3)):
        frame = line.sent(side)
        ip = parse_ipv4(frame[14:], verify_checksum=True)
        assert (ip.tos, ip.ttl, ip.identification, ip.dont_fragment) == (tos, ttl, count, True)
        assert udp_checksum(ip.payload, ip.source, ip.destination) is ChecksumState.GOOD
        udp = parse_udp(ip.payload)
        assert (udp.source_port, udp.destination_port) == (2222, 2222)
        items = struct.unpack_from("<HHHIIHHH", udp.data)
        connection, size = (O_TO_T, 70) if side == "scanner" else (T_TO_O, 66)
        assert items == (2, 0x8002, 8, connection, count, 0x00B1, size, count)
        assert len(udp.data) == 18 + size
        assert frame[-68:-64] == (b"\x01\0\0\0" if side == "scanner" else struct.pack("<H", 66) + struct.pack("<H", 10))


def test_tshark_reads_every_packet_of_both_sides_without_a_complaint(tmp_path):
    line = Line()
    frames = []
    for _ in range(5):
        line.run(0.01)
        frames += [line.sent("scanner"), line.sent("drive")]
    octets = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 65535, 1)
    octets += b"".join(struct.pack("<IIII", 1, n, len(f), len(f)) + f for n, f in enumerate(frames))
    (tmp_path / "class1.pcap").write_bytes(octets)
    fields = ("enip.cpf.sai.connid", "enip.cpf.sai.seq", "cip.seq", "_ws.expert", "udp.checksum.status")
    checked = ("-o", "udp.check_checksum:TRUE", "-o", "ip.check_checksum:TRUE")
    rows = tshark_fields(tmp_path / "class1.pcap", *fields, "frame.protocols", options=checked)
    assert len(rows) == 10
    assert {int(row[0], 16) for row in rows} == {O_TO_T, T_TO_O}
    assert [int(row[1]) for row in rows] == [n for n in range(1, 6) for _ in range(2)]
    assert {row[3] for row in rows} == {""}
    assert {row[4] for row in rows} == {"1"}
    assert all("cipio" in row[5] or "enip" in row[5] for row in rows)


def test_sequences_count_what_is_sent_and_the_interval_is_the_packet_interval():
    line = Line(rpi=12_345_000)
    line.rest()
    line.run(2.0)
    provider = line.drive.ppm[0]
    assert 150 < provider.sent <= 162
    assert int(provider.sequence) == int(provider.counter) == provider.sent
    consumer = line.scanner.cpm[0]
    assert consumer.missed == 0
    assert consumer.interval_sum_ns == (int(consumer.received) - 1) * 12_345_000
    assert consumer.jitter_sum_ns == 0


def test_old_and_repeated_packets_are_dropped_and_counted_and_the_sequence_may_wrap():
    line = Line()
    tick(line.drive, 0, line.now)
    consumer = line.drive.cpm[0]
    for sequence in (0xFFFFFFFE, 0xFFFFFFFF, 0, 0, 0xFFFFFFFF, 1, 0x80000000):
        line.give(packet(sequence, sequence & 0xFFFF))
    assert consumer.received == 5
    assert consumer.discarded[DISCARD_COUNTER] == 2
    line.give(packet(0x80000001 + 0x80000000 - 0x100000000 & 0xFFFFFFFF, 7))
    assert consumer.discarded[DISCARD_COUNTER] == 3


def test_a_repeated_sequence_count_keeps_the_connection_and_its_data_are_not_taken():
    line = Line(multiplier=4)
    tick(line.drive, 0, line.now)
    consumer, image = line.drive.cpm[0], line.drive.image[0]
    line.give(packet(1, 1, data=in_words([5] * 16)))
    for n in range(2, 20):
        line.give(packet(n, 1, run=0, data=in_words([n] * 16)), wait=0.03)
        tick(line.drive, 0, line.now)
    assert (consumer.repeated, consumer.received, consumer.expirations) == (18, 19, 0)
    assert (image.received[FIRST], image.valid) == (5, 1)
    line.give(packet(20, 2, data=in_words([6] * 16)), wait=0.01)
    assert image.received[FIRST] == 6


def test_the_first_packet_of_a_connection_repeats_none_whatever_its_count():
    line = Line(multiplier=100)
    tick(line.drive, 0, line.now)
    consumer = line.drive.cpm[0]
    for number in range(3):
        # the row's own count is 0
        line.give(packet(1 + number, number), wait=0.01)
    assert (consumer.received, consumer.repeated) == (3, 0)
    events = line.drive.events[: int(line.drive.engine[0].event_head)]
    assert [int(event.value) for event in events if event.kind == engine_row.PROVIDER_CHANGED] == [1]


def test_idle_makes_the_image_invalid_without_ending_the_connection():
    line = Line()
    line.run(0.05)
    assert line.drive.image[0].valid
    line.scanner.ppm[0].data_status = STATUS_GOOD & ~STATUS_RUN
    line.scanner.image[0].sent[FIRST] = 99
    line.run(0.05)
    image = line.drive.image[0]
    assert (image.valid, image.lost, image.received[FIRST]) == (0, LOST_STOP, 0)
    assert ("drive", engine_row.PROVIDER_CHANGED, 0) in line.events
    line.scanner.ppm[0].data_status = STATUS_GOOD
    line.run(0.05)
    assert (image.valid, image.received[FIRST]) == (1, 99)
    assert line.drive.cpm[0].expirations == 0


def test_silence_ends_after_the_interval_times_the_multiplier():
    line = Line(multiplier=16)
    line.run(0.1)
    last = int(line.drive.cpm[0].last_ns)
    line.scanner.ppm[0].active = 0
    line.run(0.5)
    image = line.drive.image[0]
    ((_, _, waited),) = [event for event in line.events if event[:2] == ("drive", engine_row.EXPIRED)]
    assert 160 * MS < waited <= 161 * MS
    assert (image.valid, image.lost) == (0, LOST_EXPIRED)
    assert line.now - last == 500 * MS
    received = int(line.drive.cpm[0].received)
    line.scanner.ppm[0].active = 1
    line.run(0.1)
    assert line.drive.cpm[0].received == received, "a connection that has timed out takes nothing more"


@pytest.mark.parametrize(("planned", "waits"), [(None, 10_000 * MS), (300 * MS, 300 * MS)])
def test_the_first_packet_is_awaited_longer(planned, waits):
    line = Line(first_hold_ns=planned)
    line.rest()
    line.scanner.ppm[0].active = line.drive.ppm[0].active = 0
    line.run(waits / 1e9 - 0.005)
    assert line.events == []
    line.run(0.06)
    ((kind, waited),) = [(kind, value) for side, kind, value in line.events if side == "drive"]
    assert kind == engine_row.EXPIRED
    assert waits < waited <= waits + 50 * MS
    assert line.drive.cpm[0].expirations == 1


def test_packets_that_were_left_out_are_counted_by_the_sequence_count():
    line = Line()
    tick(line.drive, 0, line.now)
    line.give(packet(1, 0xFFFE))
    line.give(packet(2, 0xFFFF), wait=0.010)
    line.give(packet(5, 2), wait=0.030)
    consumer = line.drive.cpm[0]
    assert consumer.missed == 2
    assert consumer.jitter_sum_ns == 0


@pytest.mark.parametrize("checksum", ["good", "none", "unfinished"])
def test_a_datagram_without_a_finished_checksum_is_taken(checksum):
    line = Line()
    tick(line.drive, 0, line.now)
    line.give(packet(checksum=checksum))
    assert line.drive.cpm[0].received == 1


@pytest.mark.parametrize(
    "fields",
    [
        {"options": bytes.fromhex("01010101")},
        {"tag": bytes.fromhex("8100a000")},
        {"more_items": struct.pack("<HH", 0x8001, 16) + bytes(16)},
        {"padding": bytes(5)},
    ],
    ids=str,
)
def test_options_tags_and_further_items_do_not_hide_the_data(fields):
    line = Line()
    tick(line.drive, 0, line.now)
    line.give(packet(data=in_words([7] * 16), **fields))
    assert line.drive.image[0].received[FIRST + 15] == 7


@pytest.mark.parametrize(
    ("frame", "reason"),
    [
        (packet(data=bytes(63)), DISCARD_LENGTH),
        (packet(data=bytes(66)), DISCARD_LENGTH),
        (packet(source=IPv4Address("10.77.1.251")), DISCARD_SOURCE),
        (packet(destination=IPv4Address("10.77.0.12")), DISCARD_SOURCE),
        (packet(checksum="bad"), DISCARD_CHECKSUM),
        (packet(connection=O_TO_T + 1), None),
        (packet(port=2223), None),
        (packet()[:90], None),
    ],
    ids=["short", "long", "another sender", "another address", "checksum", "unknown", "another port", "cut"],
)
def test_what_is_not_this_connection_s_is_counted_and_changes_nothing(frame, reason):
    line = Line()
    tick(line.drive, 0, line.now)
    line.give(frame)
    consumer, engine = line.drive.cpm[0], line.drive.engine[0]
    assert consumer.received == 0
    assert [i for i, n in enumerate(consumer.discarded) if n] == ([] if reason is None else [reason])
    assert engine.unknown + engine.malformed == (reason is None)


def test_a_group_s_address_is_a_destination_like_any_other():
    group = IPv4Address("239.192.1.32")
    line = Line(destination=multicast_mac(group), destination_address=group, ttl=1)
    line.run(0.1)
    assert line.sent("drive")[:6].hex() == "01005e400120"
    assert parse_ipv4(line.sent("drive")[14:]).destination == group
    assert line.scanner.cpm[0].received > 5


def impair(line: Line, kind: int, side: str = "drive", direction: str = "out", **settings) -> None:
    table = ImpairmentTable(getattr(line, side))
    table.add(0, direction, kind, settings=settings)
    table.channel_opened(0, direction, 0)


def test_loss_is_seen_by_the_other_side_as_missing_updates():
    line = Line(multiplier=32)
    line.run(0.1)
    table = ImpairmentTable(line.drive)
    table.add(0, "out", LOSS, count=3)
    table.channel_opened(0, "out", 0)
    line.run(0.2)
    assert line.drive.ppm[0].suppressed == 3
    assert line.scanner.cpm[0].missed == 3


def test_loss_on_the_way_in_is_not_the_controller_s_gap():
    line = Line(multiplier=32)
    line.run(0.1)
    table = ImpairmentTable(line.drive)
    table.add(0, "in", LOSS, count=3)
    table.channel_opened(0, "in", 0)
    line.run(0.2)
    consumer = line.drive.cpm[0]
    assert (consumer.discarded[DISCARD_IMPAIRED], consumer.missed) == (3, 0)


def test_a_packet_whose_data_item_was_corrupted_on_its_way_in_is_not_taken():
    line = Line(multiplier=100)
    tick(line.drive, 0, line.now)
    consumer = line.drive.cpm[0]
    table = ImpairmentTable(line.drive)
    table.channel_opened(0, "in", 0)
    # checksums that hold, as of a damaged sender
    table.add(0, "in", CORRUPT, settings={"amount": 1, "mends": 1})
    item, changed = slice(56, 60), 0
    for number in range(1, 400):
        # whatever the last one's numbers were changed to
        consumer.sequence = consumer.counter = number - 1
        sent, before = packet(number, number), int(consumer.received)
        line.give(sent, wait=0.01)
        seen = line.drive.rx_octets[CHANGED_AT : CHANGED_AT + len(sent)].tobytes()
        if seen[item] != sent[item]:
            changed += 1
            assert int(consumer.received) == before
    assert changed > 5


def test_a_corrupted_length_takes_no_other_octets_into_the_checksum_of_a_frame_that_is_changed_afterwards():
    sent: list[list[bytes]] = []
    for others in (0x00, 0x5A):
        line = Line()
        line.run(0.05)
        columns, size = line.drive, int(line.drive.ppm[0].length)
        columns.frames[:, size:] = columns.frames[1:] = others
        table = ImpairmentTable(columns)
        table.add(0, "out", CORRUPT, settings={"amount": 1})
        table.add(0, "out", FRAME_ID, settings={"amount": 1})
        table.channel_opened(0, "out", 0)
        frames = []
        for cycle in range(1, 2000):
            count = tick(columns, 0, line.now + cycle * RPI)
            frames += [columns.frames[row, :size].tobytes() for row in columns.tx_row[:count]]
        sent.append(frames)
    assert len({frame[38:40] for frame in sent[0]}) > 8, "lengths were corrupted"
    assert sent[0] == sent[1]


def test_frozen_sequences_expire_the_receiver_with_checksums_that_hold():
    line = Line()
    line.run(0.1)
    impair(line, COUNTER_FREEZE)
    line.run(0.3)
    consumer = line.scanner.cpm[0]
    assert consumer.expirations == 1
    assert consumer.discarded[DISCARD_COUNTER] > 2
    assert consumer.discarded[DISCARD_CHECKSUM] == 0


def test_an_originator_made_idle_on_the_wire_only_is_idle_to_the_target():
    line = Line()
    line.run(0.1)
    impair(line, PROVIDER_STOP, "scanner")
    line.run(0.1)
    assert line.drive.image[0].lost == LOST_STOP
    assert line.drive.cpm[0].discarded[DISCARD_CHECKSUM] == 0


@pytest.mark.parametrize("amount", [-10, 8, 3])
def test_a_packet_of_another_length_is_whole_and_refused(amount):
    line = Line()
    impair(line, LENGTH, amount=amount)
    line.run(0.1)
    consumer = line.scanner.cpm[0]
    assert consumer.discarded[DISCARD_LENGTH] > 5
    assert consumer.received == 0
    held = line.drive.frames[4:]
    (row,) = {int(i) for i in np.flatnonzero(held[:, 12])[:1]}
    frame = held[row, : 14 + 20 + 8 + 18 + 66 + amount].tobytes()
    ip = parse_ipv4(frame[14:], verify_checksum=True)
    assert udp_checksum(ip.payload, ip.source, ip.destination) is ChecksumState.GOOD
    assert struct.unpack_from("<H", ip.payload, 8 + 16)[0] == 66 + amount


def test_a_wrong_connection_id_belongs_to_nobody():
    line = Line()
    impair(line, FRAME_ID, amount=1, whole=0)
    line.run(0.1)
    assert line.scanner.engine[0].unknown > 5


def test_an_overrun_skips_packets_and_no_sequence():
    line = Line()
    line.run(0.1)
    before = int(line.drive.ppm[0].sequence)
    line.now += 55 * MS
    tick(line.drive, 0, line.now)
    assert line.drive.ppm[0].late == 4
    assert line.drive.ppm[0].sequence == before + 1
    assert next_due(line.drive, line.now) > line.now


def test_a_plan_outside_of_its_frame_is_refused():
    line = Line()
    with pytest.raises(InternalError, match="lies outside"):
        line.drive_rows.open_consumer(
            Class1ConsumerPlan(
                image=0, port=7, destination=DRIVE, destination_address=DRIVE_IP, source_address=SCANNER_IP,
                connection_id=1, data_length=4, rpi_ns=RPI, multiplier=4, words=[(word_code(1), 3)],
            )
        )  # fmt: skip


def test_a_heartbeat_has_a_sequence_count_and_nothing_else():
    line = Line()
    rows = line.drive_rows
    row = rows.open_consumer(
        Class1ConsumerPlan(
            image=0, port=7, destination=DRIVE, destination_address=DRIVE_IP, source_address=SCANNER_IP,
            connection_id=77, data_length=0, rpi_ns=RPI, multiplier=4, words=[], feeds=False,
        )
    )  # fmt: skip
    tick(line.drive, 0, line.now)
    whole = packet(connection=77, checksum="none")
    start = len(whole) - 64 - 4 - 2 - 2
    beat = bytearray(whole[:start] + b"\x02\0" + b"\x01\0")
    beat[16:18] = struct.pack(">H", len(beat) - 14)
    beat[38:40] = struct.pack(">H", len(beat) - 34)
    beat[24:26] = bytes(2)
    beat[24:26] = struct.pack(">H", 0xFFFF ^ summed(bytes(beat[14:34])))
    line.give(bytes(beat))
    assert line.drive.cpm[row].received == 1
    assert not line.drive.image[0].valid


def test_random_and_mutated_packets_change_nothing_but_counters():
    line = Line()
    line.run(0.05)
    random = np.random.default_rng(44818)
    good = np.zeros(FRAME_SLOT, np.uint8)
    # behind those already taken: whatever is left whole is old
    whole = packet(1, 1)
    good[: len(whole)] = list(whole)
    rounds = 100 if IS_COMPILED else 3
    before = line.drive.image[0].received.copy()
    for _ in range(rounds):
        frames = random.integers(0, 256, (RX_BATCH, FRAME_SLOT), dtype=np.uint8)
        frames[::2] = good
        frames[1::2, 12:24] = list(whole[12:24])
        for i in range(0, RX_BATCH, 2):
            for _ in range(random.integers(1, 5)):
                frames[i, random.integers(0, 66)] = random.integers(0, 256)
        line.drive.rx_frames[:] = frames
        line.drive.rx_length[:] = random.integers(-5, FRAME_SLOT + 50, RX_BATCH)
        line.drive.rx_length[::4] = len(whole)
        line.drive.rx_port[:] = 7
        line.drive.rx_ns[:] = line.now
        receive(line.drive, RX_BATCH)
    assert line.drive.engine[0].malformed > 0
    assert line.drive.cpm[0].discarded.sum() > 0
    assert (line.drive.image[0].received == before).all()
    line.run(0.2)
    assert line.drive.image[0].valid
    assert class1.locate(good, len(whole)) == class1.LEAST_PLACE
