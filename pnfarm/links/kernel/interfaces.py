"""Making, finding and removing network interfaces (macvlan, veth, bridge), through rtnetlink.

Everything here blocks for milliseconds and is called in a worker thread (:func:`run_to_completion`): pyroute2's
synchronous sockets do not work inside a running event loop.  Removal goes by interface group, in one
request for the whole farm: one by one, 256 macvlans take 4.5 s, as the kernel waits a grace period for each.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import functools
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, Self, TypeVar

import anyio
from pyroute2 import IPRoute
from pyroute2.netlink.exceptions import NetlinkError

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.links.base import Port, PortSpec
from pnfarm.links.kernel.network import remove_rules
from pnfarm.links.kernel.ownership import bridge_name, doomed_group_of, group_of, interface_prefix, is_own, tag
from pnfarm.links.kernel.silence import Marked, bring_up, silence

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator, Sequence
    from types import TracebackType

__all__ = ["InterfaceFacts", "Interfaces", "VethPair", "remove_leftovers", "remove_leftovers_now", "run_to_completion"]

_P = ParamSpec("_P")
_T = TypeVar("_T")

_IFF_UP = 0x1
_IFF_LOOPBACK = 0x8
_ARPHRD_ETHER = 1
#: How long the kernel may take to let frames through an interface that was set up.
_OPERATIONAL_SECONDS = 2.0
#: State of a bridge's port that takes no frames yet: its carrier was not noticed (BR_STATE_DISABLED).
_BRIDGE_PORT_DISABLED = 0
#: A farm's own bridge passes LLDP: IEEE 802.1D would have it drop 01:80:C2:00:00:0E.
_FORWARD_LLDP = 0x4000

_NEEDS_NET_ADMIN = (
    "making network interfaces needs CAP_NET_ADMIN in this network namespace: run as root, or try `pnfarm demo`, "
    "which brings a namespace of its own"
)


def mac_text(mac: bytes) -> str:
    return mac.hex(":")


@dataclass(frozen=True, slots=True)
class InterfaceFacts:
    """An interface as the kernel reports it.  ``kind`` is empty for a NIC."""

    index: int
    name: str
    mac: bytes
    kind: str
    flags: int
    hardware: int
    alias: str
    group: int

    @property
    def is_up(self) -> bool:
        return bool(self.flags & _IFF_UP)

    @property
    def is_ethernet(self) -> bool:
        return self.hardware == _ARPHRD_ETHER and not self.flags & _IFF_LOOPBACK


@dataclass(frozen=True, slots=True)
class VethPair:
    """A drive's end and the interface at the other end of its cable."""

    port: Port
    peer: Port


async def run_to_completion(function: Callable[_P, _T], *args: _P.args, **kwargs: _P.kwargs) -> _T:
    """Run a blocking function in a thread; a cancelled caller leaves only once it has finished.

    So whatever the function made or removed is known when the cancellation arrives at the caller's clean-up.
    """
    loop = asyncio.get_running_loop()
    future = loop.run_in_executor(None, functools.partial(function, *args, **kwargs))
    try:
        return await asyncio.shield(future)
    except asyncio.CancelledError:
        with anyio.CancelScope(shield=True):
            while not future.done():
                # a second cancellation changes nothing: the first is on its way to the caller
                with contextlib.suppress(asyncio.CancelledError):
                    await asyncio.wait([future])
        raise


class Interfaces:
    """An open rtnetlink socket; a context manager, for one thread."""

    def __init__(self) -> None:
        try:
            self._route: Any = IPRoute()
        except OSError as exc:
            raise EnvironmentError_(f"the kernel cannot be asked about interfaces: {exc.strerror}") from exc

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._route.close()

    # -- finding

    def everything(self) -> list[InterfaceFacts]:
        """Every interface of this network namespace."""
        return [_facts(message) for message in self._route.get_links()]

    def find(self, name: str, what: str) -> InterfaceFacts:
        """The interface of that name; ``what`` names its purpose in the error.

        Raises :class:`~pnfarm.errors.EnvironmentError_`, naming those that there are.
        """
        # of a thousand interfaces the kernel lists only this one
        with contextlib.suppress(NetlinkError):
            return _facts(self._route.link("get", ifname=name)[0])
        every = self.everything()
        there = ", ".join(sorted(facts.name for facts in every if facts.is_ethernet)) or "none"
        raise EnvironmentError_(f"{what} {name} does not exist on this machine: Ethernet interfaces here are {there}")

    def find_usable(self, name: str, what: str) -> InterfaceFacts:
        """Like :meth:`find`; the interface must be Ethernet and up."""
        facts = self.find(name, what)
        if not facts.is_ethernet:
            raise EnvironmentError_(
                f"{what} {name} is not an Ethernet interface: name a NIC, a veth end, a bridge or a bond"
            )
        if not facts.is_up:
            raise EnvironmentError_(f"{what} {name} is down: bring it up with `ip link set {name} up`")
        return facts

    def owned(self, farm: str) -> list[InterfaceFacts]:
        """What a farm of this name made, in this run or an earlier one."""
        return [facts for facts in self.everything() if is_own(farm, facts.name, facts.alias, facts.group)]

    def free_names(self, farm: str) -> Iterator[str]:
        """``pf<hash>-0``, ``pf<hash>-1`` ..., without those that exist (another farm's hash may be equal)."""
        taken = {facts.name for facts in self.everything()}
        prefix = interface_prefix(farm)
        return (name for n in range(1_000_000) if (name := f"{prefix}-{n}") not in taken)

    # -- making

    def create_macvlans(self, farm: str, parent: str, wanted: Sequence[PortSpec]) -> list[Port]:
        """One macvlan in bridge mode for each spec, silent, up, in order.  Removes them all when one fails."""
        below = self.find_usable(parent, "parent interface")
        names = self.free_names(farm)
        with self._all_or_nothing(farm):
            made = []
            for spec in wanted:
                name = next(names)
                self._add(
                    f"macvlan for {spec.station} on {parent}",
                    ifname=name,
                    kind="macvlan",
                    link=below.index,
                    macvlan_mode="bridge",
                    address=mac_text(spec.mac),
                    group=group_of(farm),
                )
                made.append(name)
            ports = self._ports(made, wanted)
            self._start(farm, ports, wanted, f"on {parent}")
        return ports

    def create_veths(self, farm: str, bridge: str | None, wanted: Sequence[PortSpec]) -> list[VethPair]:
        """One veth pair for each spec, both ends up; the far ends join ``bridge`` if one is named."""
        above = None if bridge is None else self._usable_bridge(bridge)
        names = self.free_names(farm)
        with self._all_or_nothing(farm):
            made = []
            for spec in wanted:
                name = next(names)
                self._add(
                    f"veth for {spec.station}",
                    ifname=name,
                    kind="veth",
                    address=mac_text(spec.mac),
                    group=group_of(farm),
                    peer={"ifname": f"{name}p", "IFLA_GROUP": group_of(farm)},
                )
                made.append(name)
            ports = self._ports(made, wanted)
            peers = self._ports([f"{name}p" for name in made], wanted)
            if above is not None:
                for peer in peers:
                    self._enslave(peer.index, above)
            silence(
                [
                    Marked(p.index, p.name, tag(farm, spec.station), arp=True)
                    for p, spec in zip(peers, wanted, strict=True)
                ]
            )
            bring_up([peer.index for peer in peers])
            self._start(farm, ports, wanted, "")
            # the kernel takes them in this order
            self.wait_operational(ports[-1].index, peers[-1].index)
        return [VethPair(port, peer) for port, peer in zip(ports, peers, strict=True)]

    def create_cable(self, near: str, far: str) -> None:
        """A plain veth pair of these names, both ends up: a wire inside an own namespace.  Belongs to no farm."""
        self._add(f"veth {near}", ifname=near, kind="veth", peer=far)
        bring_up([self.find(name, "veth").index for name in (near, far)])

    def remove_cable(self, near: str) -> None:
        """Remove a pair of :meth:`create_cable`."""
        self._route.link("del", index=self.find(near, "veth").index)

    def create_bridge(self, farm: str) -> Port:
        """A plain bridge ``pf<hash>-br`` of the farm's own: no spanning tree, no snooping, passes LLDP."""
        name = bridge_name(farm)
        with self._all_or_nothing(farm):
            self._add("bridge of the farm", ifname=name, kind="bridge", group=group_of(farm))
            facts = self.find(name, "bridge")
            settings = Path(f"/sys/class/net/{name}/bridge")
            try:
                self._route.link(
                    "set", index=facts.index, kind="bridge", br_stp_state=0, br_forward_delay=0,
                    br_mcast_snooping=0, br_group_fwd_mask=_FORWARD_LLDP,
                )  # fmt: skip
            except NetlinkError as exc:
                raise EnvironmentError_(f"the kernel refused the settings of {settings}: {_why(exc)}") from exc
            silence([Marked(facts.index, name, tag(farm, "bridge"), arp=True)])
            bring_up([facts.index])
        return Port(name, facts.index, facts.mac)

    def mark(self, farm: str, index: int, name: str, station: str) -> None:
        """Tag and silence an interface that was made by other means (a TAP), and set it up."""
        try:
            self._route.link("set", index=index, group=group_of(farm))
        except NetlinkError as exc:
            raise EnvironmentError_(f"{name} cannot be changed: {_why(exc)}") from exc
        silence([Marked(index, name, tag(farm, station), arp=True)])
        bring_up([index])

    def enslave(self, index: int, bridge: str) -> None:
        """Put an own interface into a bridge."""
        self._enslave(index, self._usable_bridge(bridge))

    # -- changing

    def set_up(self, index: int, up: bool) -> None:
        """Raises :class:`~pnfarm.errors.EnvironmentError_` when the interface is gone or its address is in use."""
        try:
            bring_up([index], up)
        except OSError as exc:
            raise EnvironmentError_(
                f"interface {index} cannot be set {'up' if up else 'down'}: {exc.strerror}"
            ) from exc

    def wait_operational(self, *indexes: int) -> None:
        """Wait until frames pass through interfaces that were set up: until then, the kernel drops what is sent.

        A port of a bridge is enabled after it is operational, so both are checked; its forward delay, where it has
        one, is not waited for.  That takes milliseconds, more on a busy machine.  Returns after two seconds without
        it: there is no carrier.
        """
        end = time.monotonic() + _OPERATIONAL_SECONDS
        while time.monotonic() < end:
            if all(_passes_frames(message) for message in self._route.get_links(*indexes)):
                return
            time.sleep(0.002)

    def set_mac(self, index: int, mac: bytes) -> None:
        """Give an own interface another address; its groups and its state stay."""
        try:
            self._route.link("set", index=index, address=mac_text(mac))
        except NetlinkError as exc:
            why = "another interface of the same parent has it" if exc.code == errno.EADDRINUSE else _why(exc)
            raise EnvironmentError_(f"interface {index} cannot have the address {mac_text(mac)}: {why}") from exc

    # -- removing

    def remove(self, farm: str, only: Collection[int] | None = None) -> list[str]:
        """Remove a farm's interfaces (those with an index in ``only``, or all); returns the names of those

        removed. Interfaces that no farm of this name made stay untouched, whatever their index.
        """
        own = [facts for facts in self.owned(farm) if only is None or facts.index in only]
        # an interface takes its addresses and routes with it, but no rule that names it
        remove_rules([facts.name for facts in own])
        doomed = doomed_group_of(farm)
        wanted = {facts.index for facts in own}
        if len(own) > 1 and all(facts.index in wanted for facts in self.everything() if facts.group == doomed):
            with contextlib.suppress(NetlinkError):  # what is left afterwards is removed one by one
                for facts in own:
                    self._route.link("set", index=facts.index, group=doomed)
                self._route.link("del", group=doomed)
        for facts in self.owned(farm):
            if facts.index not in wanted:
                continue
            try:
                self._route.link("del", index=facts.index)
            except NetlinkError as exc:
                # a veth's far end is removed with the near one
                if exc.code != errno.ENODEV:
                    raise EnvironmentError_(f"interface {facts.name} cannot be removed: {_why(exc)}") from exc
        return sorted(facts.name for facts in own)

    # -- inside

    @contextlib.contextmanager
    def _all_or_nothing(self, farm: str) -> Iterator[None]:
        before = {facts.index for facts in self.owned(farm)}
        try:
            yield
        except BaseException:
            for facts in self.owned(farm):
                if facts.index not in before:
                    # the first error is the one to report; `pnfarm down` removes what this could not
                    with contextlib.suppress(NetlinkError):
                        self._route.link("del", index=facts.index)
            raise

    def _add(self, what: str, **options: Any) -> None:
        try:
            self._route.link("add", **options)
        except NetlinkError as exc:
            raise _refusal(what, options, exc) from exc

    def _usable_bridge(self, name: str) -> InterfaceFacts:
        facts = self.find_usable(name, "bridge")
        if facts.kind != "bridge":
            raise EnvironmentError_(f"bridge {name} is a {facts.kind or 'NIC'}: name a bridge, or leave it out")
        return facts

    def _enslave(self, index: int, bridge: InterfaceFacts) -> None:
        try:
            self._route.link("set", index=index, master=bridge.index)
        except NetlinkError as exc:
            if exc.code in {errno.EXFULL, errno.ENOSPC}:
                raise EnvironmentError_(
                    f"bridge {bridge.name} is full: Linux allows 1,023 ports a bridge, use several or a macvlan link"
                ) from exc
            raise EnvironmentError_(f"bridge {bridge.name} refused a port: {_why(exc)}") from exc

    def _ports(self, names: Sequence[str], wanted: Sequence[PortSpec]) -> list[Port]:
        by_name = {facts.name: facts for facts in self.everything()}
        missing = [name for name in names if name not in by_name]
        if missing:
            raise EnvironmentError_(
                f"interface {missing[0]} vanished while the farm started: is another program removing it?"
            )
        return [Port(name, by_name[name].index, by_name[name].mac) for name, _ in zip(names, wanted, strict=True)]

    def _start(self, farm: str, ports: Sequence[Port], wanted: Sequence[PortSpec], where: str) -> None:
        """Tag, silence and set up the drives' ends."""
        silence(
            [
                Marked(p.index, p.name, tag(farm, spec.station), kernel=spec.kernel)
                for p, spec in zip(ports, wanted, strict=True)
            ]
        )
        try:
            bring_up([port.index for port in ports])
        except OSError as exc:
            if exc.errno in {errno.EBUSY, errno.EADDRINUSE}:
                raise EnvironmentError_(
                    f"a drive's MAC address is in use {where}: is the farm's last run still there (`pnfarm down`), "
                    "or do two drives have the same `mac`?"
                ) from exc
            raise EnvironmentError_(f"the farm's interfaces cannot be set up {where}: {exc.strerror}") from exc


def _passes_frames(message: Any) -> bool:
    port_state = message.get_nested("IFLA_LINKINFO", "IFLA_INFO_SLAVE_DATA", "IFLA_BRPORT_STATE")
    return bool(message.get_attr("IFLA_OPERSTATE") == "UP" and port_state != _BRIDGE_PORT_DISABLED)


def _facts(message: Any) -> InterfaceFacts:
    info = message.get_attr("IFLA_LINKINFO")
    address = message.get_attr("IFLA_ADDRESS") or ""
    return InterfaceFacts(
        index=int(message["index"]),
        name=str(message.get_attr("IFLA_IFNAME")),
        mac=bytes.fromhex(address.replace(":", "")),
        kind=str((info.get_attr("IFLA_INFO_KIND") if info is not None else None) or ""),
        flags=int(message["flags"]),
        hardware=int(message["ifi_type"]),
        alias=str(message.get_attr("IFLA_IFALIAS") or ""),
        group=int(message.get_attr("IFLA_GROUP") or 0),
    )


def _why(error: NetlinkError) -> str:
    return str(error.args[1]) if len(error.args) > 1 else str(error)


def _refusal(what: str, options: dict[str, Any], error: NetlinkError) -> Exception:
    """The kernel's error number as a sentence."""
    kind = options["kind"]
    match error.code:
        case errno.EPERM | errno.EACCES:
            return EnvironmentError_(f"{what}: {_NEEDS_NET_ADMIN}")
        case errno.EOPNOTSUPP:
            return EnvironmentError_(
                f"{what}: this kernel has no {kind} interfaces, load the module with `modprobe {kind}`"
            )
        case errno.EBUSY:
            return EnvironmentError_(
                f"{what}: the parent is in use (port of a bridge or bond, or has a macvlan of another mode), "
                "name the bridge as the parent or take the NIC out of it"
            )
        case errno.EADDRNOTAVAIL:
            address = options.get("address")
            return ConfigError(
                f"{what}: {address} is not a station address, its first octet must be even and not all zero"
            )
        case errno.EADDRINUSE:
            return ConfigError(
                f"{what}: {options.get('address')} is the address of another interface, choose another `mac`"
            )
        case _:
            return EnvironmentError_(f"{what} was refused by the kernel: {_why(error)}")


def remove_leftovers_now(farm: str) -> list[str]:
    """Blocking form of :func:`remove_leftovers`, for use outside an event loop."""
    with Interfaces() as interfaces:
        return interfaces.remove(farm)


async def remove_leftovers(farm: str) -> list[str]:
    """Remove what an earlier, killed run of this farm left in this network namespace; the names of those removed.

    Take the :class:`~pnfarm.links.kernel.ownership.FarmLock` first: a running farm's interfaces carry the same marks.
    """
    return await run_to_completion(remove_leftovers_now, farm)
