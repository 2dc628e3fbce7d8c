"""The layouts of a planned AR's cyclic frames.

:func:`plan_frames` decides the only open point, the position of
all data in the frames, of which there are two as far as possible:

* input frame: for each submodule with inputs, and for each without any data, its data and then its provider status;
  after all of these one consumer status for each submodule with outputs;
* output frame: the same the other way round.

A submodule without any data has only a provider status in the input frame, as the captures of real
controllers show and IEC 61158-6-10 (ExpectedSubmoduleBlockReq, SubmoduleProperties Type = NO_IO) requires.  With
DiscardIOXS a submodule has no status octet in either frame; the request still lists it, with offset 0 if it
has no octet at all, as captured controllers do.  A frame shorter than the C_SDU's 40 octets is padded after its last
status.

Each clock of the submodules has CRs of its own, and what does not fit into a frame goes into a further CR, in the order
of the submodules, or the longest first if that takes too many.  A consumer status is in a CR of its submodule's clock
if there is one with room, else in any other.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.protocols.profinet.cm.ar import DataPlace, IocrLayout, IocsPlace
from pnfarm.protocols.profinet.cm.controller.plan import ordered
from pnfarm.protocols.profinet.wire.cm.connect import ArType
from pnfarm.protocols.profinet.wire.cm.expected import SubmoduleProperties
from pnfarm.protocols.profinet.wire.cm.iocr import (
    FRAME_ID_ASSIGN,
    FRAME_SEND_OFFSET_ANY,
    MAX_C_SDU,
    MIN_C_SDU,
    IocrType,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from pnfarm.protocols.profinet.cm.controller.plan import ArPlan, Clock, PlannedSubmodule

__all__ = ["PlannedCr", "divide", "plan_frames"]

#: SubmoduleProperties that would change the content of frames; this controller does not support them.
_UNSUPPORTED_PROPERTIES = SubmoduleProperties.REDUCE_INPUT_LENGTH | SubmoduleProperties.REDUCE_OUTPUT_LENGTH


def _check_submodules(plan: ArPlan) -> None:
    if plan.device_access and (plan.submodules or plan.ar_type != ArType.IOSAR):
        raise ConfigError("device access is a supervisor's AR (ar_type 6) and expects no submodules")
    if not plan.submodules and not plan.device_access:
        raise ConfigError("the plan expects no submodule, at least the device's access point (slot 0) is needed")
    seen: set[tuple[int, int, int]] = set()
    modules: dict[tuple[int, int], int] = {}
    for submodule in plan.submodules:
        key = (submodule.api, submodule.slot, submodule.subslot)
        if key in seen:
            raise ConfigError(f"{submodule.where} is given twice in the plan, each place can be expected once")
        seen.add(key)
        ident = modules.setdefault(key[:2], submodule.module_ident)
        if ident != submodule.module_ident:
            raise ConfigError(
                f"{submodule.where} expects module 0x{submodule.module_ident:08X} and another submodule of that slot "
                f"0x{ident:08X}, one slot has one module"
            )
        if submodule.input_bytes < 0 or submodule.output_bytes < 0:
            raise ConfigError(f"{submodule.where} has a negative length, octets count from 0")
        if submodule.properties & _UNSUPPORTED_PROPERTIES:
            raise ConfigError(
                f"{submodule.where} has properties 0x{submodule.properties:04X}, reduced lengths cannot be planned"
            )


class PlannedCr:
    """One CR of those that submodules are divided into; ``data`` and ``iocs`` have their places in its frame."""

    def __init__(self, clock: Clock) -> None:
        self.clock = clock
        self.octets = 0
        self.data: list[DataPlace] = []
        self.iocs: list[IocsPlace] = []

    def take(self, octets: int) -> int:
        """The place of so many octets more; 0 where there are none."""
        start = self.octets if octets else 0
        self.octets += octets
        return start


def _choose(crs: list[PlannedCr], clock: Clock, octets: int, *, any_clock: bool = False) -> PlannedCr:
    """The first CR of this clock with room for so many octets, else one of any clock, else a new one."""
    with_room = [cr for cr in crs if cr.octets + octets <= MAX_C_SDU]
    found = next((cr for cr in with_room if cr.clock == clock), with_room[0] if any_clock and with_room else None)
    if found is None:
        crs.append(found := PlannedCr(clock))
    return found


def _packed(submodules: Iterable[PlannedSubmodule], own: Clock, *, is_input: bool) -> list[PlannedCr]:
    crs: list[PlannedCr] = []
    for s in submodules:
        if s.provides_input if is_input else s.output_bytes:
            octets, length = _octets(s, is_input=is_input), s.input_bytes if is_input else s.output_bytes
            cr = _choose(crs, s.clock or own, octets)
            start = cr.take(octets)
            iops = None if s.discards_ioxs else start + length
            cr.data.append(DataPlace(s.api, s.slot, s.subslot, start, length, iops))
    for s in submodules:
        if s.output_bytes if is_input else s.provides_input:
            status = 0 if s.discards_ioxs else 1
            cr = _choose(crs, s.clock or own, status, any_clock=True)
            cr.iocs.append(IocsPlace(s.api, s.slot, s.subslot, cr.take(status) if status else None))
    return crs or [PlannedCr(own)]


def _divide(submodules: Sequence[PlannedSubmodule], own: Clock, iocr_type: IocrType, most: int) -> list[PlannedCr]:
    is_input, name = iocr_type is IocrType.INPUT, iocr_type.name.lower()
    longest = max(submodules, key=lambda s: _octets(s, is_input=is_input), default=None)
    if longest is not None and (octets := _octets(longest, is_input=is_input)) > MAX_C_SDU:
        raise ConfigError(f"{longest.where} has {octets} octets of {name} with the status, a frame takes {MAX_C_SDU}")
    crs = _packed(submodules, own, is_input=is_input)
    if len(crs) > most:
        # the longest first leave less room unused
        by_length = sorted(submodules, key=lambda s: _octets(s, is_input=is_input), reverse=True)
        crs = _packed(by_length, own, is_input=is_input)
    if len(crs) > most:
        total, cycles = sum(cr.octets for cr in crs), len({cr.clock for cr in crs})
        raise ConfigError(
            f"{total} octets of {name} in {cycles} cycle{'s' * (cycles > 1)} need {len(crs)} frames of up to "
            f"{MAX_C_SDU}, the device has up to {most} {name} CR{'s' * (most > 1)}"
        )
    return crs


def _octets(submodule: PlannedSubmodule, *, is_input: bool) -> int:
    """Of the data and their status in a frame of this direction."""
    octets = submodule.input_bytes if is_input else submodule.output_bytes
    return octets + (0 if submodule.discards_ioxs else 1)


def divide(
    submodules: Iterable[PlannedSubmodule], own: Clock, most: tuple[int, int]
) -> tuple[list[PlannedCr], list[PlannedCr]]:
    """Input and output CRs for these submodules: as few as their octets and clocks need, ``most`` of each direction.

    ``own`` is the clock of those that have none.  Raises ConfigError when they need more.
    """
    found = ordered(submodules)
    return _divide(found, own, IocrType.INPUT, most[0]), _divide(found, own, IocrType.OUTPUT, most[1])


def _layout(plan: ArPlan, iocr_type: IocrType, number: int, reference: int, cr: PlannedCr) -> IocrLayout:
    factor, ratio = cr.clock
    return IocrLayout(
        iocr_type=int(iocr_type),
        iocr_reference=reference,
        frame_id=plan.input_frame_id + number if iocr_type is IocrType.INPUT else FRAME_ID_ASSIGN,
        data_length=max(cr.octets, MIN_C_SDU),
        send_clock_factor=factor,
        reduction_ratio=ratio,
        # the frames of several CRs of one cycle are spread
        phase=(plan.phase - 1 + number) % ratio + 1,
        frame_send_offset=FRAME_SEND_OFFSET_ANY,
        watchdog_factor=plan.watchdog_factor,
        data_hold_factor=plan.watchdog_factor,
        data=tuple(cr.data),
        iocs=tuple(cr.iocs),
        properties=plan.rt_class,
    )


def plan_frames(plan: ArPlan) -> tuple[IocrLayout, ...]:
    """The layouts of the input CRs, then of the output CRs: one of each, or as many as the data need.

    They are empty for device access.  Raises ConfigError when another plan expects nothing, when a place is given
    twice, or when there is more data than the device's CRs hold.
    """
    _check_submodules(plan)
    own = plan.send_clock_factor, plan.reduction_ratio
    inputs, outputs = divide(plan.submodules, own, (plan.input_crs, plan.output_crs))
    numbered = [(IocrType.INPUT, *one) for one in enumerate(inputs)]
    numbered += [(IocrType.OUTPUT, *one) for one in enumerate(outputs)]
    # IOCRReferences count as those of the captured controllers: the inputs' from 1, the outputs' after them
    return tuple(
        _layout(plan, iocr_type, number, reference, cr)
        for reference, (iocr_type, number, cr) in enumerate(numbered, start=1)
    )
