"""Cyclic channels: providers (PPM) and consumers (CPM), one row per IO communication relation.

The rows carry the names of the two protocol machines of IEC 61158-6-10.  A drive provides its input
data and consumes its output data; a controller the other way round; the engine does not care.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = [
    "CPM",
    "DISCARDS",
    "FRAME_SLOT",
    "INTERVAL_BUCKETS",
    "INTERVAL_EDGES_NS",
    "JITTER_BUCKETS",
    "JITTER_EDGES_NS",
    "MAX_IOCS",
    "MAX_IOPS",
    "MAX_STATUSES",
    "MAX_WORDS",
    "PPM",
]

#: Octets of one frame's buffer: an Ethernet frame with VLAN tag, rounded up to an odd number of cache lines: the first
#: lines of many frames share all of a cache.
FRAME_SLOT = 1600
#: Telegram words of one channel; the longest telegram of the manuals has 34.
MAX_WORDS = 64
#: Provider status octets of one axis in a frame.
MAX_IOPS = 4
#: Provider status octets of a provider's frame that an impairment may change.
MAX_STATUSES = 64
#: Consumer status octets of a provider's frame that an impairment may change.
MAX_IOCS = 32

#: Why a cyclic frame was dropped, by index of ``CPM.discarded``.
DISCARDS = (
    "wrong-length", "wrong-source", "old-counter", "data-invalid", "impaired", "transfer-status", "bad-checksum",
)  # fmt: skip
DISCARD_LENGTH = 0
DISCARD_SOURCE = 1
DISCARD_COUNTER = 2
DISCARD_INVALID = 3
DISCARD_IMPAIRED = 4
DISCARD_TRANSFER = 5
DISCARD_CHECKSUM = 6

#: Upper bounds of the interval histogram, nanoseconds; a last bucket takes the rest.
INTERVAL_EDGES_NS = (
    250_000, 500_000, 750_000, 900_000, 1_000_000, 1_100_000, 1_250_000, 1_500_000, 2_000_000, 2_500_000, 3_000_000,
    4_000_000, 5_000_000, 6_000_000, 8_000_000, 10_000_000, 12_000_000, 16_000_000, 20_000_000, 24_000_000, 32_000_000,
    48_000_000, 64_000_000, 96_000_000, 128_000_000, 256_000_000, 512_000_000, 1_024_000_000,
)  # fmt: skip
INTERVAL_BUCKETS = len(INTERVAL_EDGES_NS) + 1

#: Upper bounds of the jitter histogram, nanoseconds; a last bucket takes the rest.
JITTER_EDGES_NS = (
    1_000, 5_000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000, 2_000_000, 4_000_000, 8_000_000,
    16_000_000,
)  # fmt: skip
JITTER_BUCKETS = len(JITTER_EDGES_NS) + 1

# Header and trailer of the data of a frame (``framing``; :mod:`pnfarm.engine.channels.framing`).
FRAMING_RTC = 0  # frame id before the data, cycle counter and data status after it
FRAMING_CLASS1 = 1  # UDP: connection id, sequences and run/idle header before the data, words little-endian

# States of both machines.
IDLE = 0
W_START = 1
FRUN = 2  # CPM only: active, no frame yet
RUN = 3

# Bits of the data status octet (IEC 61158-6-10, APDU status).
STATUS_PRIMARY = 0x01
STATUS_VALID = 0x04
STATUS_RUN = 0x10
STATUS_NO_PROBLEM = 0x20
STATUS_IGNORE = 0x80
STATUS_GOOD = STATUS_PRIMARY | STATUS_VALID | STATUS_RUN | STATUS_NO_PROBLEM

# A row's life (``active``).
CLOSED = 0
OPEN = 1
RIDES = 2  # it has no frames of its own: a part of those of another row, for another axis of the station

#: GOOD; a bit of its own, so that consumers test it alone.
IOXS_GOOD = 0x80
#: BAD, found by the IO device (IEC 61158-6-10, IOxS: DataState 0, Instance 2).
IOXS_BAD = 0x40

PPM = Layout(
    "ppm",
    "A provider: one frame sent every ``cycle_ns``. Its Ethernet frame is in the same row of the frame store.",
    [
        # each tick looks at these
        Field("active", "u1", "", "station", "CLOSED, OPEN or RIDES: set last when a row is ready, cleared first"),
        Field("state", "u1", "", "transmit", "IDLE, W_START or RUN"),
        Field("framing", "u1", "", "station", "header and trailer of its data: FRAMING_*"),
        Field("words", "u1", "", "station", "telegram words in the frame"),
        Field("next_ns", "i8", "ns", "transmit", "when the next frame is due"),
        Field(
            "cycle_ns", "i8", "ns", "station", "31,250 ns x send clock factor x reduction ratio, or the packet interval"
        ),
        # and these are of each frame
        Field("image", "i4", "", "station", "row of the process image that fills it"),
        Field("rider", "i4", "", "station", "row of the next axis in its frames + 1, 0 = none"),
        Field("port", "i4", "", "station", "where it goes out: interface index, or port of a memory link"),
        Field("exit", "i4", "", "station", "interface through which it leaves, 0 = its port"),
        Field("impairment", "i4", "", "fault", "first impairment on this row + 1, 0 = none"),
        Field(
            "slip_ns", "f8", "ns", "station", "so much earlier than after a cycle each frame leaves: its clock drifts"
        ),
        Field("sent", "i8", "frames", "transmit", "frames given to the link"),
        Field("last_ns", "i8", "ns", "transmit", "when the last frame went out"),
        Field("frame_id", "u4", "", "station", "frame id, or connection id"),
        Field("sequence", "u4", "", "transmit", "sequence number of the last packet"),
        Field("length", "u2", "octets", "station", "whole frame from the destination address, without FCS"),
        Field("data_offset", "u2", "octets", "station", "first octet of the IO data in the frame"),
        Field("counter", "u2", "31.25 us", "transmit", "cycle counter of the last frame, or its sequence count"),
        Field("counter_step", "u2", "31.25 us", "station", "send clock factor x reduction ratio"),
        Field("data_status", "u1", "", "station", "APDU data status while nothing is impaired"),
        Field("run_idle", "u1", "", "station", "1 = a run/idle header is before the data"),
        Field("iops_count", "u1", "", "station", "provider status octets that follow the image"),
        Field("iocs_count", "u1", "", "station", "consumer status octets"),
        Field("pieces", "u2", "", "station", "pieces of plain data in its frames"),
        Field("piece", "i4", "", "station", "row of the first of them"),
        Field("plain", "i4", "", "station", "row of the station's plain data that they come from"),
        Field("iops_offset", "u2", "octets", "station", "place of each provider status", (MAX_IOPS,)),
        Field("word_code", "u1", "", "station", "slot * 4 + part of each word", (MAX_WORDS,)),
        Field("word_offset", "u2", "octets", "station", "each word's place in the frame", (MAX_WORDS,)),
        Field("iocs_offset", "u2", "octets", "station", "place of each consumer status", (MAX_IOCS,)),
        Field("statuses", "u1", "", "station", "provider status octets of all axes and pieces that may be changed"),
        Field("status_offset", "u2", "octets", "station", "place of each of these", (MAX_STATUSES,)),
        Field("slipped_ns", "f8", "ns", "transmit", "part of a nanosecond that is left of that"),
        Field("phase_ns", "i8", "ns", "station", "offset in the cycle, spreads the farm's frames"),
        Field("suppressed", "i8", "frames", "transmit", "frames that an impairment kept back"),
        Field("late", "i8", "frames", "transmit", "cycles skipped because the engine came more than a cycle late"),
    ],
    cache_lines=True,
)

CPM = Layout(
    "cpm",
    "A consumer: frames of one frame id at one port, watched by the data hold timer.",
    [
        # each tick looks at these
        Field("active", "u1", "", "station", "CLOSED, OPEN or RIDES: set last when a row is ready, cleared first"),
        Field("state", "u1", "", "receive", "IDLE, W_START, FRUN (no frame yet) or RUN"),
        Field(
            "feeds",
            "u1",
            "",
            "station",
            "1 = it owns the drive's set points: valid, lost and the drive's own fault follow this channel",
        ),
        Field("fed", "u1", "", "receive", "1 while its data is in the process image"),
        Field("framing", "u1", "", "station", "header and trailer of its data: FRAMING_*"),
        Field("zeroes", "u1", "", "station", "1 = data of a provider in STOP or with bad IOPS count as zero"),
        Field("words", "u1", "", "station", "telegram words in the frame"),
        Field("iops_count", "u1", "", "station", "provider status octets"),
        Field("image", "i4", "", "station", "row of the process image that it fills"),
        Field("rider", "i4", "", "station", "row of the next axis in its frames + 1, 0 = none"),
        Field("pieces", "u2", "", "station", "pieces of plain data in its frames"),
        Field("port", "i4", "", "station", "where it comes in"),
        Field("last_ns", "i8", "ns", "receive", "arrival of the last valid frame"),
        Field(
            "hold_ns", "i8", "ns", "station", "data hold time: cycle x data hold factor, by the consumer's own clock"
        ),
        # and these are of each frame
        Field("frame_id", "u4", "", "station", "frame id, or connection id"),
        Field("generation", "u4", "", "station", "counts the row's uses, so that an old event is told from a new one"),
        Field("destination", "i8", "", "station", "the address that it consumes at: MAC as a 48-bit number"),
        Field("source", "i8", "", "station", "the only sender accepted: MAC as a 48-bit number, or IPv4 address"),
        Field("impairment", "i4", "", "fault", "first impairment on this row + 1, 0 = none"),
        Field(
            "data_length",
            "u2",
            "octets",
            "station",
            "IO data between frame id and cycle counter, as agreed in the IOCR",
        ),
        Field("counter", "u2", "31.25 us", "receive", "cycle counter of the last valid frame, or its sequence count"),
        Field("received", "i8", "frames", "receive", "valid frames"),
        Field("cycle_ns", "i8", "ns", "station", "cycle that the peer promised"),
        Field("interval_sum_ns", "i8", "ns", "receive", "sum of all intervals"),
        Field("jitter_sum_ns", "i8", "ns", "receive", "sum of all deviations"),
        Field("impaired", "u4", "frames", "receive", "frames that an impairment dropped since the last valid one"),
        Field("data_status", "u1", "", "receive", "data status of the last valid frame, or 1 if its sender was in RUN"),
        Field("iops", "u1", "", "receive", "worst provider status of the last valid frame"),
        Field(
            "interval_bucket",
            "u1",
            "",
            "receive",
            "bucket of the last interval, where the next one is looked for first",
        ),
        Field("jitter_bucket", "u1", "", "receive", "bucket of the last deviation, likewise"),
        Field("run_idle", "u1", "", "station", "1 = a run/idle header is before the data"),
        Field("piece", "i4", "", "station", "row of the first piece"),
        Field("plain", "i4", "", "station", "row of the station's plain data that they go to"),
        Field("iops_offset", "u2", "octets", "station", "place of each, from the first octet of IO data", (MAX_IOPS,)),
        Field("word_code", "u1", "", "station", "slot * 4 + part of each word", (MAX_WORDS,)),
        Field(
            "word_offset", "u2", "octets", "station", "each word's place, from the first octet of IO data", (MAX_WORDS,)
        ),
        Field("sequence", "u4", "", "receive", "sequence number of the last valid packet"),
        Field("address", "i8", "", "station", "the IPv4 address that it consumes at; not of real-time frames"),
        Field("repeated", "i8", "frames", "receive", "valid packets that brought the data of the one before once more"),
        Field(
            "first_hold_ns", "i8", "ns", "station", "how long the first frame is awaited, 0 = the station watches that"
        ),
        Field("missed", "i8", "frames", "receive", "frames that the controller left out, by its cycle counter"),
        Field("expirations", "i8", "", "receive", "data hold timer ran out"),
        Field("discarded", "i8", "frames", "receive", "dropped frames by reason (DISCARDS)", (len(DISCARDS),)),
        Field(
            "intervals", "i8", "frames", "receive", "histogram of the time between valid frames", (INTERVAL_BUCKETS,)
        ),
        Field(
            "jitters",
            "i8",
            "frames",
            "receive",
            "histogram of the intervals' deviation from the cycle",
            (JITTER_BUCKETS,),
        ),
        Field("late", "i8", "frames", "receive", "frames that came more than half a cycle late"),
        Field("late_own", "i8", "frames", "receive", "those of them before which the engine itself was as late"),
        Field("late_at_ns", "i8", "ns", "receive", "when the newest late frame came, 0 = none"),
        Field("late_by_ns", "i8", "ns", "receive", "how late it was"),
        Field("late_engine_ns", "i8", "ns", "receive", "how late the engine had been"),
    ],
    cache_lines=True,
)
