"""A drive as a PROFINET device: telegrams in slots, base mode parameter access, faults as diagnosis, for each axis."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

from pnfarm.buses.profinet.axis_slots import model_slots
from pnfarm.buses.profinet.binding import DriveRecords, axis_places, describe_device
from pnfarm.buses.profinet.described.records import DescribedRecords
from pnfarm.buses.profinet.device.fault_diagnosis import FaultDiagnosis
from pnfarm.buses.profinet.device.network import StationNetwork
from pnfarm.buses.profinet.frame_layout import Carrier, frame_layout
from pnfarm.protocols.deadlines import earliest
from pnfarm.protocols.profinet.records.directory import ISOCHRONOUS
from pnfarm.station.parameter_words import StationParameterWords
from pnfarm.station.step_time import SLOWEST_STEP_NS, longest_step_ns
from pnfarm.table.axis_codes import CMD_ACKNOWLEDGE, CMD_RAISE_FAULT, CONTROL_BY_PLC, OBJECT_CONTROL_UNIT

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.buses.profinet.config.drive import ProfinetDriveConfig
    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.frame_layout import FrameLayout
    from pnfarm.drives.telegrams.telegram import Telegram
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
    from pnfarm.protocols.profinet.dcp.device import DcpDevice
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription
    from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue
    from pnfarm.protocols.profinet.gsdml.records import ParameterRecord
    from pnfarm.station.axis import Axis
    from pnfarm.station.station import Station

__all__ = ["DriveKind"]


class _AxisPart:
    """One axis on the bus: its slots, its cyclic parameter channel, its faults as diagnosis."""

    def __init__(self, axis: Axis, slots: frozenset[int], shift: int) -> None:
        self.axis = axis
        self.slots = slots
        self.shift = shift
        self.parameter_words = StationParameterWords(axis.store, axis.station.latency)
        self.diagnosis: FaultDiagnosis

    @property
    def first_slot(self) -> int:
        """The slot of the module that stands for the telegram."""
        return min(self.slots)


class DriveKind:
    """See :class:`pnfarm.buses.profinet.device.kind.Kind`."""

    def __init__(self, station: Station) -> None:
        self._station = station
        self.model = station.axes[0].model
        self.records: DriveRecords
        self._parts: tuple[_AxisPart, ...] = ()
        self._cm: CmDevice

    @property
    def _settings(self) -> ProfinetDriveConfig:
        return cast("ProfinetDriveConfig", self._station.config)

    @property
    def _first(self) -> Axis:
        return self._station.axes[0]

    def commission(self, kept: Mapping[str, Any], *, has_address: bool) -> None:
        """An address of the farm file counts as set by a tool."""
        if has_address and "ip" not in kept:
            self._first.store.commission_address()

    def take_name(self, kept: dict[str, Any]) -> str | None:
        name = self._first.store.take_name()
        if name is not None and "drive" in kept:
            number = str(self.model.access.station_name)
            parameters = {pnu: value for pnu, value in kept["drive"]["parameters"].items() if pnu != number}
            kept["drive"] = {**kept["drive"], "parameters": parameters}
        return name

    def describe(self, mac: bytes) -> DeviceDescription:
        strict = self._settings.strict
        axes = axis_places(self.model, self._settings.axes)
        description = describe_device(self.model, mac, strict=strict, axes=axes)
        if self._settings.ignores_clock:
            description = replace(description, ignored_records=ISOCHRONOUS)
        maker, further = self._settings.maker, None
        if maker is not None:
            description = replace(description, own_records=maker.indexes)
            further = DescribedRecords(self._record, self._station.note, strict=strict)
        own = model_slots(self.model)
        # the words of a drive with one axis are those of all its submodules
        several = len(self._station.axes) > 1
        self._parts = tuple(
            _AxisPart(axis, frozenset(slot + place.shift for slot in own), place.shift)
            for axis, place in zip(self._station.axes, axes, strict=True)
        )
        point = next(s for m in description.modules for s in m.submodules)
        slots = {part.first_slot if several else point.slot: part.axis.number for part in self._parts}
        stores = [axis.store for axis in self._station.axes]
        latency = self._station.latency
        self.records = DriveRecords(stores, slots, point.api, strict=strict, latency=latency, further=further)
        return description

    def _record(self, slot: int, subslot: int, index: int) -> ParameterRecord | None:
        """That of the submodule which is plugged there, by the maker's file."""
        one, maker = self._cm.plugged.get((slot, subslot)), self._settings.maker
        if one is None or maker is None:
            return None
        found = maker.records(one.module_ident, one.submodule_ident)
        return next((record for record in found if record.index == index), None)

    def join(self, dcp: DcpDevice, mac: bytes, cm: CmDevice) -> None:
        self._cm = cm
        cm.moved = self._moved
        for part in self._parts:
            part.axis.store.network = StationNetwork(dcp, mac, self.model.limits.ports)
            part.diagnosis = FaultDiagnosis(
                part.axis.store, cm.diagnosis, part.shift, lambda place: cm.plugged.submodule(*place) is not None
            )

    def _moved(self) -> None:
        for part in self._parts:
            part.diagnosis.report()

    def next_deadline(self) -> int | None:
        return earliest(*(part.parameter_words for part in self._parts))

    def handle_timeout(self, now: int) -> None:
        for part in self._parts:
            part.parameter_words.handle_timeout(now)

    # -- cyclic data -------------------------------------------------------------------------------------------------

    plain_row = 0

    @property
    def diagnoses(self) -> DiagnosisCatalogue | None:
        return None if self._settings.maker is None else self._settings.maker.catalogue

    def follow_modules(self) -> None:
        """The plugged modules determine the telegrams of the frames; a supplementary one counts if it is expected."""
        expected = {(e.slot, s.subslot) for ar in self._cm.ars for e in ar.expected for s in e.submodules}
        for part in self._parts:
            module = self._cm.plugged.module(part.first_slot)
            telegram = None if module is None else self._telegram_in(module)
            if module is None or telegram is None:
                continue
            places = {s.subslot: s.submodule_ident for s in module.submodules if (s.slot, s.subslot) in expected}
            beside = (
                number
                for number, one in self.model.profidrive.supplements.items()
                if places.get(one.module.data.subslot) == one.module.data.ident
            )
            part.axis.store.plug_telegram(telegram.number, module.module_ident, next(beside, None))

    def _telegram_in(self, module: ModuleDescription) -> Telegram | None:
        idents = {one.subslot: one.submodule_ident for one in module.submodules}
        return self.model.profidrive.telegram_by_module(module.module_ident, idents)

    def _set_points(self, part: _AxisPart) -> set[tuple[int, int]]:
        """(slot, subslot) of the submodules whose owner feeds an axis: the first with outputs, else all of its slot."""
        module = self._cm.plugged.module(part.first_slot)
        submodules = module.submodules if module is not None else ()
        slot = part.first_slot
        places = [(slot, s.subslot) for s in submodules if s.output_bytes][:1]
        return set(places or ((slot, s.subslot) for s in submodules))

    def feeds(self, ar: ArChannels) -> frozenset[int]:
        usable = {key[1:] for key in ar.expected if key not in ar.bad}
        return frozenset(part.axis.number for part in self._parts if usable & self._set_points(part))

    def layout(self, channel: IocrLayout, ar: ArChannels, unusable: frozenset[ExpectedKey]) -> FrameLayout:
        several = len(self._parts) > 1
        carriers = [
            Carrier(
                part.axis.store.input_words() if channel.is_input else part.axis.store.output_words(),
                part.slots if several else None,
                part.axis.index,
                part.axis.number in ar.feeds,
            )
            for part in self._parts
        ]
        return frame_layout(channel, carriers, unusable)

    def opened(self, fastest_ns: int) -> None:
        for part in self._parts:
            part.axis.handle.axis.step_ns = longest_step_ns(fastest_ns)

    def fed(self, ar: ArChannels) -> None:
        for part in self._fed_by(ar):
            part.axis.store.watchdog_ns = ar.watchdog_ns
            part.axis.handle.axis.interpolation.settings.cycle_ns = ar.set_point_cycle_ns

    def closed(self, ar: ArChannels, *, any_left: bool) -> None:
        for part in self._fed_by(ar):
            part.axis.store.channels_closed()
        for part in self._parts if not any_left else self._fed_by(ar):
            part.parameter_words.reset()
        if not any_left:
            for part in self._parts:
                part.axis.handle.axis.step_ns = SLOWEST_STEP_NS

    def _fed_by(self, ar: ArChannels) -> list[_AxisPart]:
        return [part for part in self._parts if part.axis.number in ar.feeds]

    def lost(self, ar: ArChannels) -> None:
        """The axes that it fed raise their own fault, unless they have a telegram monitoring time of their own."""
        for part in self._fed_by(ar):
            settings = part.axis.handle.axis.faults.settings
            if int(settings.loss_fault) and not int(settings.loss_delay_ns):
                part.axis.handle.push_command(CMD_RAISE_FAULT, int(settings.loss_fault))

    def telegram(self) -> int:
        return self._first.store.telegram_number

    @property
    def telegrams(self) -> dict[int, tuple[int, dict[int, int]]]:
        known = {number: telegram.module for number, telegram in self.model.profidrive.telegrams.items()}
        return {number: (one.ident, {one.data.subslot: one.data.ident}) for number, one in known.items()}

    def telegram_of(self, module: ModuleDescription) -> int | None:
        found = self._telegram_in(module)
        return None if found is None else found.number

    def key_of(self, slot: int, subslot: int | None = None) -> tuple[str | int, ...]:
        """See :class:`pnfarm.buses.profinet.device.kind.Kind`; a telegram has several submodules."""
        del subslot
        if not slot:
            return ("access_point",)
        part = next((part for part in self._parts if slot in part.slots), None)
        return ("axes", part.axis.number, "telegram") if part and len(self._parts) > 1 else ("telegram",)

    def module_name(self, ident: int) -> str:
        found = next((number for number, (module, _) in self.telegrams.items() if module == ident), None)
        return "" if found is None else f"telegram {found}"

    def record_complaint(self, slot: int, subslot: int, index: int) -> str:
        """By the maker's file; of its own records the status of the answer says it."""
        further = self.records.further
        return "" if further is None else further.complaints.get((slot, subslot, index), "")

    # -- events ------------------------------------------------------------------------------------------------------

    def fault_raised(self, axis: int, number: int) -> None:
        self._parts[axis].diagnosis.raised(number)
        self._follow_faults()

    def faults_cleared(self, axis: int) -> None:
        self._parts[axis].diagnosis.cleared()
        self._follow_faults(acknowledged=axis)

    def _follow_faults(self, acknowledged: int | None = None) -> None:
        """A control unit reports the faults of every axis, and without control by the PLC it is acknowledged by theirs.

        SINAMICS S110 Function Manual, 06/2012, table 9-27 (CU_STW1.10) and table 9-30 (CU_ZSW1.10).
        """
        rows = [part.axis.handle.axis for part in self._parts]
        for number, row in enumerate(rows):
            if int(row.profidrive.settings.object) != OBJECT_CONTROL_UNIT:
                continue
            others = any(each.faults.code[0] for each in rows if each is not row)
            row.profidrive.settings.others_faulty = others
            controlled = int(row.profidrive.stw1_seen) & CONTROL_BY_PLC
            if acknowledged not in {None, number} and not others and not controlled:
                self._parts[number].axis.handle.push_command(CMD_ACKNOWLEDGE)

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        self._parts[axis].parameter_words.take(value, now)

    def address_set(self) -> None:
        self._first.store.address_set()

    def address_forgotten(self) -> None:
        self._first.store.address_forgotten()

    def reset_application(self) -> None:
        for axis in self._station.axes:
            axis.store.restore(None)
            axis.store.power_on()
        if self.records.further is not None:
            self.records.further.forget()
