"""The dynamic part of the assemblies, octets 36 to 63: EIP.CMDMAP and EIP.RSPMAP (AKD EtherNet/IP manual 9.1, 9.5).

Mapped parameters follow each other without gaps; an entry of 0 takes no room (assumed).  Only map type 2 has it.  What
map type 1, a custom map, holds is not said: nothing.
"""

from __future__ import annotations

from typing import Any

from pnfarm.firmware.ethernetip.octets import put, received_octet
from pnfarm.firmware.ethernetip.tasks import TASK_MAP, idle, post
from pnfarm.firmware.motion.travel import limits_reached
from pnfarm.firmware.records.ethernetip import MAPPED
from pnfarm.firmware.whole_numbers import clamp32
from pnfarm.table.axis_codes import NUMBER_MASK
from pnfarm.table.compiling.compiled import inlined

__all__ = ["COMMAND_SIZES", "DYNAMIC", "DYNAMIC_MAP", "MAP_TYPE", "RESPONSE_SIZES", "show_map", "take_map"]

#: Octet of the map type, and the one after the static part.
MAP_TYPE = 33
STATIC = 36
END = 64
DYNAMIC = STATIC
DYNAMIC_MAP = 2
#: Instances that can be mapped, and their octets.
COMMAND_SIZES = {383: 2, 384: 4, 386: 4}
RESPONSE_SIZES = {286: 4, 288: 4, 478: 2, 8192: 2, 8193: 1, 8195: 1}
DIGEST = 0x7FFFFFFFFFFF
FACTOR = 257


@inlined
def _command_size(instance: int) -> int:
    return 2 if instance == 383 else 4 if instance in (384, 386) else 0


@inlined
def take_map(axis: Any, image: Any) -> None:
    """Once in each step: mapped set points that changed are reported."""
    own = axis.ethernetip
    if not image.valid or received_octet(image, MAP_TYPE) != DYNAMIC_MAP:
        own.map_seen = 0
        return
    octets = 0
    for entry in range(MAPPED):
        octets += _command_size(int(own.settings.command_map[entry]))
    octets = min(octets, END - STATIC)
    if octets == 0:
        return
    digest = 1
    for place in range(STATIC, STATIC + octets):
        digest = (digest * FACTOR + received_octet(image, place) + 1) & DIGEST
    if digest != own.map_seen and idle(image) and own.loading == 0:
        own.map_seen = digest
        post(own, image, TASK_MAP, 0, 1, 0)


@inlined
def _status3(axis: Any, inputs: int) -> int:
    """STATUS3: active, torque allowed, limit switches, software limits (:mod:`pnfarm.drives.parameters.computed`)."""
    limits = limits_reached(axis)
    switch = int(axis.machine.limit_switch)
    return (
        (1 if axis.drive.state >= 4 else 0)
        | (inputs >> 6 & 1) << 1
        | (switch >> 1 & 1) << 2
        | (switch & 1) << 3
        | (limits >> 1 & 1) << 4
        | (limits & 1) << 5
    )


@inlined
def show_map(axis: Any, image: Any, inputs: int) -> None:
    """The mapped actual values; ``inputs`` is DRIVE_INPUTS."""
    place = STATIC
    step = axis.travel.settings.position_step
    for entry in range(MAPPED):
        instance = int(axis.ethernetip.settings.response_map[entry])
        size = 0
        value = 0
        if instance == 286:
            size = 4
            value = clamp32((axis.profile.position - axis.homing.origin) / step)
        elif instance == 288:
            size = 4
            value = clamp32((axis.positioning.following_error - axis.measurement.position_deviation) / step)
        elif instance == 478:
            size = 2
            value = int(axis.faults.code[0]) & NUMBER_MASK
        elif instance == 8192:
            size = 2
            value = round(axis.supply.voltage)
        elif instance == 8193:
            size = 1
            value = _status3(axis, inputs)
        elif instance == 8195:
            size = 1
            value = int(axis.machine.inputs) & 0x7F
        if size == 0 or place + size > END:
            continue
        put(image, place, size, value)
        place += size
