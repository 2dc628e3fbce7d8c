"""The drive's own clock, which may run faster or slower than time does.

Everything that a drive times by counting its own oscillator goes by this clock: when its cyclic frames leave, how long
its data hold timer waits, its firmware (ramps, profiles, dwells, supervision, the pace of its parameter channel, the
measurement of its speed), and its sign of life, which counts the frames that it sends.  The station keeps farm time
where ppm mean nothing: boot and answers to parameter requests, the timers of DCP, RPC, alarms, LLDP and SNMP.

``drift`` is the share by which the clock is faster: 50e-6 is 50 ppm, below 0 it is slower.  Where it is 0 nothing here
is computed.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiled import compiled

__all__ = ["drive_time", "true_duration"]


@compiled
def drive_time(clock: Any, now: int) -> int:
    """What the drive's clock shows at ``now``, ns."""
    return now + int((now - clock.settings.start_ns) * clock.settings.drift)


def true_duration(duration_ns: int, drift: float) -> float:
    """How long it takes in truth, ns, until a clock with this drift has counted ``duration_ns``."""
    return duration_ns / (1.0 + drift)
