"""What is behind a PROFINET device: a drive with its axes, or a station that a maker's file describes.

Below this interface nothing knows which.  A kind gives the device its description, its own records and its part of the
cyclic frames, and is notified of what concerns these.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Protocol

from pnfarm.protocols.profinet.records.handler import RecordHandler

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from pnfarm.buses.profinet.device.ar_channels import ArChannels
    from pnfarm.buses.profinet.frame_layout import FrameLayout
    from pnfarm.protocols.profinet.cm.ar import ExpectedKey, IocrLayout
    from pnfarm.protocols.profinet.cm.device.cmdev import CmDevice
    from pnfarm.protocols.profinet.dcp.device import DcpDevice
    from pnfarm.protocols.profinet.description import DeviceDescription, ModuleDescription
    from pnfarm.protocols.profinet.errors import RecordError
    from pnfarm.protocols.profinet.gsdml.diagnosis import DiagnosisCatalogue

__all__ = ["ApplicationRecords", "Kind"]


class ApplicationRecords(RecordHandler, Protocol):
    """The device's own records.

    ``error``, when set, refuses every access; ``withhold``, when set, is called with the time at each read of a ready
    parameter response; if it returns true, the device is still busy.
    """

    error: RecordError | None
    withhold: Callable[[int], bool] | None

    def reset(self, key: int) -> None:
        """The connection of this key ended: discard its pending responses."""

    def next_deadline(self) -> int | None:
        """When a request is to be carried out."""

    def handle_timeout(self, now: int) -> None: ...


class Kind(Protocol):
    """See the module's docstring."""

    @property
    def records(self) -> ApplicationRecords:
        """The device's own records; they are new at each power-on."""

    def commission(self, kept: Mapping[str, Any], *, has_address: bool) -> None:
        """Memory is read and the farm file not yet applied; ``has_address``: it gives one."""

    def take_name(self, kept: dict[str, Any]) -> str | None:
        """The station name that a saved parameter sets from now on, "" for none; it is no longer in ``kept``."""

    def describe(self, mac: bytes) -> DeviceDescription:
        """Power-on: the device's description; makes the records."""

    @property
    def diagnoses(self) -> DiagnosisCatalogue | None:
        """Those that the device's file names; None where there is no file."""

    def join(self, dcp: DcpDevice, mac: bytes, cm: CmDevice) -> None:
        """The machines of this power-on exist."""

    # -- time: of cyclic parameter channels

    def next_deadline(self) -> int | None:
        """When :meth:`handle_timeout` is due."""

    def handle_timeout(self, now: int) -> None: ...

    # -- cyclic data

    @property
    def plain_row(self) -> int:
        """The station's row of plain data."""

    def follow_modules(self) -> None:
        """Other modules may be plugged."""

    def layout(self, channel: IocrLayout, ar: ArChannels, unusable: frozenset[ExpectedKey]) -> FrameLayout:
        """One frame of a connection."""

    def feeds(self, ar: ArChannels) -> frozenset[int]:
        """The axes, by number, whose set points come from this connection; 0 stands for a station without axes."""

    def opened(self, fastest_ns: int) -> None:
        """A connection with IO data exists; the fastest has this cycle."""

    def fed(self, ar: ArChannels) -> None:
        """This connection feeds."""

    def closed(self, ar: ArChannels, *, any_left: bool) -> None:
        """A connection ended; ``any_left``: others with IO data remain."""

    def lost(self, ar: ArChannels) -> None:
        """An established connection ended without a release."""

    def telegram(self) -> int:
        """The telegram of the first axis, for the log; 0 where there is none."""

    @property
    def telegrams(self) -> Mapping[int, tuple[int, Mapping[int, int]]]:
        """What stands for a telegram, by its number: the module's ident, and its submodule's by subslot."""

    def telegram_of(self, module: ModuleDescription) -> int | None:
        """The telegram that a module stands for."""

    # -- what a controller expects: for who compares it with the farm file

    def key_of(self, slot: int, subslot: int | None = None) -> tuple[str | int, ...]:
        """The path in the station's group of the farm file that says what is in a slot, or in a subslot of it."""

    def module_name(self, ident: int) -> str:
        """What the farm file calls a module with this ident; empty for one that the station cannot have."""

    def record_complaint(self, slot: int, subslot: int, index: int) -> str:
        """What is wrong with a record that was written lately, in words; empty where nothing is, or none are known."""

    # -- events of an axis

    def fault_raised(self, axis: int, number: int) -> None:
        """An axis raised a fault: its diagnosis appears."""

    def faults_cleared(self, axis: int) -> None:
        """Every fault of an axis was acknowledged: their diagnosis disappears."""

    def parameter_task(self, axis: int, value: int, now: int) -> None:
        """A task of an axis came in the cyclic parameter channel."""

    # -- resets and addresses

    def address_set(self) -> None:
        """DCP set an address."""

    def address_forgotten(self) -> None:
        """A reset cleared the address."""

    def reset_application(self) -> None:
        """A factory reset cleared the application's memory."""
