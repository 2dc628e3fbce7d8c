"""mac-change: the drive has another MAC address, as after a change of its hardware."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pnfarm.errors import ConfigError
from pnfarm.faults.effects.adapter import ADAPTER
from pnfarm.faults.effects.connection import CONNECTION
from pnfarm.faults.effects.effect import POLL_NS, Effect, seed_of
from pnfarm.faults.effects.wire import WIRE
from pnfarm.faults.errors import InjectionError
from pnfarm.faults.kind import HELD, InjectionKind, ParamSpec
from pnfarm.wire.mac import format_mac

if TYPE_CHECKING:
    from pnfarm.wire.direction import Direction

__all__ = ["KIND"]


class MacChange(Effect):
    """Confirmed by the first frame that the drive sends from the new address."""

    adapter = ADAPTER
    wire = WIRE
    _changed_ns = 0

    def prepare(self) -> None:
        name = self.drive.name
        # locally administered, of one station
        made = b"\x02" + seed_of(self.spec, f"adapter of {name}").to_bytes(8, "big")[:5]
        self.mac: bytes = self.values["mac"] or made
        if self.adapter.refusal:
            raise InjectionError([("kind", self.adapter.refusal, "")])
        self._require_free()
        if self.adapter.user_of(self.mac):
            raise self._taken(f"{name} itself")

    def _require_free(self) -> None:
        if (user := self.adapter.user_of(self.mac)) not in {"", self.drive.name}:
            raise self._taken(user)

    def _taken(self, user: str) -> InjectionError:
        return InjectionError([("params.mac", f"{format_mac(self.mac)} is the address of {user}", "that of no drive")])

    def begin(self, now: int) -> None:
        # another drive may have got it since
        self._require_free()
        self.wire.listen(self._hear)
        self.adapter.change(self.mac, now)
        self._due = now + POLL_NS
        self._count(now)

    def _count(self, now: int) -> None:
        """Count the change once it is made."""
        if not self.tally.seen.checks and self.adapter.mac == self.mac:
            self.tally.note(now)
            self._changed_ns = now

    def _hear(self, direction: Direction, frame: bytes, now: int) -> None:
        if direction == "out" and frame[6:12] == self.mac:
            self._count(now)
            self.tally.confirm()

    def check(self, now: int) -> None:
        if self.adapter.failure:
            raise ConfigError(self.adapter.failure)
        self._count(now)
        connection = self.drive.find(CONNECTION)
        if self.tally.seen.activations and connection is not None and connection.sent_data(self._changed_ns + 1):
            self.tally.confirm()
        if self._due is not None and now >= self._due:
            self._due = None if self.tally.seen.confirmed else now + POLL_NS

    def end(self, now: int) -> None:
        self._due = None
        self.wire.unlisten(self._hear)
        self.adapter.restore(self.mac, now)


KIND = InjectionKind(
    "mac-change",
    "link",
    "The drive has another MAC address, as after a change of its hardware: it loses its supply, gets the address and "
    "boots, with name and IP address from its non-volatile memory.  At the end it gets its own MAC address back in the "
    "same way.  On a link whose interface is not the farm's it is refused.",
    "the change of the address",
    MacChange,
    {
        "mac": ParamSpec(
            "mac", "The other address; left out, a locally administered one by the drive's name and `seed`."
        ),
    },
    takes=HELD | {"seed"},
    place=50,
    wire="The frames end without notice; after the boot, LLDP (chassis), DCP, ARP and cyclic frames come from the "
    "other MAC address, with the same station name and IP address.",
    reports="After the watchdog, IO device failure (S7-1500: OB86; CODESYS: the device is shown as not running "
    "(assumed)). The controller finds the station by its name and sets the connection up again, "
    "unless a topology check or a switch has the old address (assumed).",
)
