"""The drive's own clock, which may run faster or slower than true time.

Everything that a drive times by its own oscillator follows this clock: when its cyclic frames leave, how long
its data hold timer waits, its firmware (ramps, profiles, dwells, supervision, the pace of its parameter channel, the
measurement of its speed), and its sign of life, which counts the frames that it sends.  The station uses farm time
where a few ppm do not matter: boot and answers to parameter requests, the timers of DCP, RPC, alarms, LLDP and SNMP.

``drift`` is the relative error of the clock: 50e-6 means 50 ppm fast, a negative value slow.  At 0 nothing here is
computed.
"""

from __future__ import annotations

from typing import Any

from pnfarm.table.compiling.compiled import inlined

__all__ = ["drive_time", "true_duration"]


@inlined
def drive_time(clock: Any, now: int) -> int:
    """Time on the drive's clock at ``now``, ns."""
    return now + int((now - clock.settings.start_ns) * clock.settings.drift)


def true_duration(duration_ns: int, drift: float) -> float:
    """True time, ns, in which a clock with this drift counts ``duration_ns``."""
    return duration_ns / (1.0 + drift)
