"""mac-change: the drive has another MAC address, as after a change of its hardware."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.adapter import ADAPTER
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Effect, Tally, Window, seed_of
from pnfarm.faults.effects.wire import WIRE
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from pnfarm.faults.effects.effect import Needs
    from pnfarm.faults.effects.evidence import Evidence
    from pnfarm.faults.effects.injection_fields import InjectionFields
    from pnfarm.faults.effects.parts import InjectedDrive
    from pnfarm.wire.direction import Direction

__all__ = ["KINDS"]


class MacChange(Effect):
    """Confirmed by the first frame that the drive sends from the new address."""

    needs: ClassVar[Needs] = (ADAPTER, WIRE)

    def __init__(self, spec: InjectionFields, drive: InjectedDrive) -> None:
        super().__init__(spec, drive)
        self._adapter = drive.part(ADAPTER)
        self._wire = drive.part(WIRE)
        self._tally = Tally()
        self._due: int | None = None
        self._changed_ns = 0
        # locally administered, of one station
        self.mac: bytes = (
            self.values["mac"] or b"\x02" + seed_of(spec, f"adapter of {drive.name}").to_bytes(8, "big")[:5]
        )
        if self._adapter.refusal:
            raise InjectionError([("kind", self._adapter.refusal, "")])
        if user := self._adapter.user_of(self.mac):
            what = f"{format_mac(self.mac)} is the address of {user}"
            raise InjectionError([("params.mac", f"{what} itself" if user == drive.name else what, "that of no drive")])

    def begin(self, window: Window, now: int) -> None:
        del window
        self._wire.listen(self._hear)
        self._adapter.change(self.mac, now)
        self._due = now + POLL_NS
        self._count(now)

    def _count(self, now: int) -> None:
        """Count the change once it is made."""
        if not self._tally.seen.checks and self._adapter.mac == self.mac:
            self._tally.note(now)
            self._changed_ns = now

    def _hear(self, direction: Direction, frame: bytes, now: int) -> None:
        if direction == "out" and frame[6:12] == self.mac:
            self._count(now)
            self._tally.confirm()

    def check(self, now: int) -> None:
        if self._adapter.failure:
            raise ConfigError(self._adapter.failure)
        self._count(now)
        connection = self.drive.find(CONNECTION)
        if self._tally.seen.activations and connection is not None and connection.sent_data(self._changed_ns + 1):
            self._tally.confirm()
        if self._due is not None and now >= self._due:
            self._due = None if self._tally.seen.confirmed else now + POLL_NS

    def end(self, now: int) -> None:
        self._due = None
        self._wire.unlisten(self._hear)
        self._adapter.restore(self.mac, now)

    def evidence(self) -> Evidence:
        return self._tally.seen

    def next_deadline(self) -> int | None:
        return self._due


KINDS = (
    InjectionKind(
        "mac-change",
        "link",
        "The drive has another MAC address, as after a change of its hardware: it loses its supply, gets the address "
        "and boots, with name and IP address from its non-volatile memory.  At the end it gets its own MAC address "
        "back in the same way.  On a link whose interface is not the farm's it is refused.",
        "the change of the address",
        MacChange,
        {
            "mac": ParamSpec(
                "mac", "The other address; left out, a locally administered one by the drive's name and `seed`."
            ),
        },
        takes=HELD | {"seed"},
        place=50,
        wire=(
            "The frames end without notice; after the boot, LLDP (chassis), DCP, ARP and cyclic frames come from "
            "the other MAC address, with the same station name and IP address."
        ),
        reports=(
            "After the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running "
            "(assumed)). The controller finds the station by its name and sets the connection up again: nothing stays "
            "behind, unless a topology check or a switch knows the old address (assumed)."
        ),
    ),
)
