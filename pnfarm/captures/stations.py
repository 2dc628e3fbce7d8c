"""The stations of a capture: names and models by MAC address, from the frames or from a farm file."""

from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING, Generic, TypeVar

from pnfarm.wire.mac import BROADCAST, format_mac, is_group

if TYPE_CHECKING:
    from collections.abc import Callable

    from pnfarm.drives.description.model import Model

__all__ = ["Bounded", "Stations"]

_K = TypeVar("_K")
_V = TypeVar("_V")

#: Stations, calls and connections kept at a time; the oldest are dropped.
MOST = 4096
#: VLANs of one station.
MOST_VLANS = 8
_MAC_OCTETS = 6


class Bounded(OrderedDict[_K, _V], Generic[_K, _V]):
    """A dictionary of at most ``most`` entries; the one set longest ago is dropped."""

    def __init__(self, most: int = MOST) -> None:
        super().__init__()
        self._most = most

    def __setitem__(self, key: _K, value: _V) -> None:
        super().__setitem__(key, value)
        # a key that was there keeps its place otherwise
        self.move_to_end(key)
        if len(self) > self._most:
            self.popitem(last=False)

    def made(self, key: _K, make: Callable[[], _V]) -> _V:
        """What is under a key, made if there is nothing yet."""
        found = self.get(key)
        if found is None:
            found = self[key] = make()
        return found


class Stations:
    """The latest name counts, but any other replaces a name taken from an interface of the capture."""

    def __init__(self) -> None:
        self._names: Bounded[bytes, str] = Bounded()
        self._guessed: Bounded[bytes, str] = Bounded()
        self._models: Bounded[bytes, Model] = Bounded()
        self._vlans: Bounded[bytes, tuple[int, ...]] = Bounded()

    def learn(self, mac: bytes, *, name: str = "", model: Model | None = None, vlan: int = 0) -> None:
        if is_group(mac):
            return
        if name and name.isprintable():
            self._names[mac] = name
        if model is not None:
            self._models[mac] = model
        if vlan and vlan not in (known := self._vlans.get(mac, ())) and len(known) < MOST_VLANS:
            self._vlans[mac] = (*known, vlan)

    def vlans(self, mac: bytes) -> str:
        """The VLANs of its frames in words; empty where they have no tag but a priority."""
        known = self._vlans.get(mac, ())
        return f"VLAN{'s' if len(known) > 1 else ''} {' and '.join(map(str, known))}" if known else ""

    def suppose(self, mac: bytes, model: Model) -> None:
        """A model by its identity; a farm file's model, which may have another identity, stays."""
        if mac not in self._models:
            self._models[mac] = model

    def guess(self, mac: bytes, name: str) -> None:
        """A capture of a farm names its interfaces after the drives."""
        if mac not in self._guessed and not is_group(mac):
            self._guessed[mac] = name

    def name_line(self, address: bytes, name: str) -> None:
        """The name of an address of a line, which is no MAC address."""
        self._guessed[address] = name

    def name(self, mac: bytes) -> str:
        """The station's name, or its address; ``?`` where there is none."""
        if not mac:
            return "?"
        found = self._names.get(mac) or self._guessed.get(mac)
        if found is not None:
            return found
        if len(mac) != _MAC_OCTETS:
            return f"station {int.from_bytes(mac, 'big')}"
        if mac == BROADCAST:
            return "everybody"
        return "all" if is_group(mac) else format_mac(mac)

    def model(self, mac: bytes) -> Model | None:
        return self._models.get(mac)
