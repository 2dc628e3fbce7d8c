"""Traces: the values of chosen fields, sampled in the engine's ticks into a ring.

A *trace* is one recording.  Its *probes* are the fields that it samples, and those that its trigger watches.  The ring
holds numbers of double precision; a trace has a part of it, as a ring of samples.  A sample is the time since
``started_ns``, ns, and the value of each probe.
"""

from __future__ import annotations

from pnfarm.table.layout import Field, Layout

__all__ = ["MAX_PROBES", "MAX_TRACES", "PROBE", "RING_VALUES", "TRACE"]

#: Rows of traces; a row is used again only after the engine has seen that its trace is over.
MAX_TRACES = 32
#: Rows of probes, for all traces.
MAX_PROBES = 8192
#: Numbers in the ring, for all traces: 32 MiB, of which the kernel provides only what was used.
RING_VALUES = 1 << 22

# States of a trace (``TRACE.state``).
IDLE = 0  # no trace, or one that the engine has not seen
ARMED = 1  # it samples, and waits for its trigger
TRIGGERED = 2
ENDED = 3  # complete; the ring keeps its samples

# How a trace is triggered (``TRACE.trigger``): by its first step, a probe's value and a level, or by the event loop.
TRIGGER_NOW = 0
TRIGGER_RISING = 1  # from below the level to the level or above
TRIGGER_FALLING = 2  # from above the level to the level or below
TRIGGER_CHANGES = 3  # another value than in the step before
TRIGGER_ABOVE = 4
TRIGGER_AT_LEAST = 5
TRIGGER_BELOW = 6
TRIGGER_AT_MOST = 7
TRIGGER_EQUAL = 8
TRIGGER_UNEQUAL = 9
TRIGGER_EVENT = 10

# Where a probe's value comes from (``PROBE.source``).
SOURCE_AXIS_REAL = 0  # a field f8 of the axis table
SOURCE_AXIS_INTEGER = 1  # a whole number in it
SOURCE_IMAGE_INTEGER = 2  # a whole number in the image table
SOURCE_IMAGE_AGE = 3  # the time since the time in a field of the image table, ns
SOURCE_PLANT = 4  # a value of the plant
SOURCE_PLAIN_UNSIGNED = 5  # from here on in plain data: a whole number, or bits of it
SOURCE_PLAIN_SIGNED = 6  # a whole number with a sign
SOURCE_PLAIN_REAL = 7  # an IEEE 754 number of 4 or 8 octets
SOURCE_PLAIN_FLAG = 8  # 1 where any bit is set
#: That time if the field is 0: none; -1 s.
NO_AGE = -1e9

TRACE = Layout(
    "trace",
    "A recording: which probes, when, and how far it is.",
    [
        Field("active", "u1", "", "station", "set last when a row is ready, cleared first when it goes"),
        Field("first_probe", "i4", "", "station", "first row of the probes that it samples"),
        Field("probes", "i4", "", "station", "number of those"),
        Field("first_watched", "i4", "", "station", "first row of the probes that the trigger watches"),
        Field("watched", "i4", "", "station", "number of those; the first that fulfils the condition triggers"),
        Field("ring_start", "i8", "", "station", "first number of its part of the ring"),
        Field("capacity", "i8", "", "station", "samples that its part of the ring holds"),
        Field("interval_ns", "i8", "ns", "station", "time between samples: the first tick at or after each multiple"),
        Field("length_ns", "i8", "ns", "station", "how long it samples from the trigger on"),
        Field("trigger", "u1", "", "station", "how it is triggered: TRIGGER_*"),
        Field("plain", "u1", "", "station", "1 = some of its probes read plain data"),
        Field("plant", "u1", "", "station", "1 = some of its probes read values of the plant"),
        Field("level", "f8", "", "station", "level of the trigger, in the probes' unit"),
        Field("fire_ns", "i8", "ns", "station", "when the event happened that triggers it, 0 = not yet"),
        Field("started_ns", "i8", "ns", "station", "the times of its samples count from here"),
        Field("state", "u1", "", "engine", "IDLE, ARMED, TRIGGERED or ENDED"),
        Field("head", "i8", "", "engine", "samples taken so far"),
        Field("next_ns", "i8", "ns", "engine", "when the next sample is due"),
        Field("missed", "i8", "", "engine", "samples that were due while no tick ran"),
        Field("trigger_ns", "i8", "ns", "engine", "when it was triggered"),
        Field("trigger_probe", "i4", "", "engine", "row of the probe that triggered it, -1 = none"),
    ],
)

PROBE = Layout(
    "probe",
    "Where one sampled value comes from: a place in the table's 64-bit words, octets of plain data, or the plant.",
    [
        Field("source", "u1", "", "station", "SOURCE_*"),
        Field("octets", "u1", "octets", "station", "how many it has in plain data"),
        Field("big", "u1", "", "station", "1 = their first one is the most significant"),
        Field("received", "u1", "", "station", "1 = plain data that the station receives"),
        Field(
            "word",
            "i4",
            "",
            "station",
            "64-bit word with the field; of plain data its first octet; of the plant the value's number",
        ),
        Field("row", "i4", "", "station", "row of the plain data"),
        Field("less", "i4", "", "station", "word whose number is subtracted (f8 only), -1 = none"),
        Field("shift", "u1", "bits", "station", "lowest bit of the field in the word"),
        Field("seen", "u1", "", "engine", "1 = before is set"),
        Field("mask", "i8", "", "station", "bits of the field, after the shift"),
        Field("sign", "i8", "", "station", "its sign bit, after the shift; 0 = unsigned"),
        Field("scale", "f8", "", "station", "factor of the field in the unit shown", default=1.0),
        Field("value", "f8", "", "engine", "its value when it was read last"),
        Field("before", "f8", "", "engine", "of a watched probe: its value in the tick before"),
    ],
)
