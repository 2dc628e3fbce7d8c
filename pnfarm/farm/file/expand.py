"""From groups to drives: names, addresses and MACs counted up, and everything that must hold between them."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from ipaddress import IPv4Address, IPv4Interface
from typing import TYPE_CHECKING, Any

from pnfarm.buses.profinet.config.clock import USUAL_FACTOR, check_clock, join_cycle, split_cycle
from pnfarm.config.realism import Realism
from pnfarm.config.tasks import drive_task
from pnfarm.config.values import expand_name
from pnfarm.farm.file.sections import (
    DEFAULT_CYCLE_NS,
    ControllerSection,
    DriveGroup,
    FarmSections,
    Impairment,
    Load,
    MemoryLink,
    Motor,
)
from pnfarm.vocabulary.durations import format_duration
from pnfarm.wire.mac import mac_from_int, mac_to_int

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pnfarm.config.known import Known, ModelFacts
    from pnfarm.config.machine import Machine
    from pnfarm.drives.model import Model
    from pnfarm.drives.motion_tasks import MotionTask

__all__ = ["Clock", "DriveConfig", "auto_mac", "clock_of", "controller_mac", "expand_sections", "own_cycle_ns"]


@dataclass(frozen=True, slots=True)
class DriveConfig:
    """One drive as the farm file wants it.

    ``index`` counts through the farm from 0; ``group`` is the entry of ``drives:`` that it comes from.
    ``model`` is the name under which the model is listed, also where the file has an alias; ``listed`` is that model
    with the parameters of the farm file's list, None where the file has no list for it.
    ``cycle_ns`` is None where the controller's counts, ``telegram`` where the file leaves it to the model.
    ``realism_by_source``: what ``realism`` says nothing of is on where a source gives the model's figure.
    For a foreign device (a file without ``farm:``) ``mac`` means nothing: the controller finds it by name.
    """

    index: int
    group: int
    name: str
    model: str
    mac: bytes
    ip: IPv4Interface | None
    gateway: IPv4Address | None
    load: Load
    motor: Motor
    machine: Machine
    strict: bool
    identity: Mapping[str, Any]
    params: Mapping[str, int | float | str | bool]
    impair: tuple[Impairment, ...]
    telegram: int | None
    cycle_ns: int | None
    hello: bool = False
    motion_tasks: tuple[MotionTask, ...] = ()
    behaviour: Mapping[str, str] = field(default_factory=dict)
    realism: Realism = field(default_factory=Realism)
    realism_by_source: bool = False
    listed: Model | None = None


@dataclass(frozen=True, slots=True)
class Clock:
    """How the built-in controller runs one drive."""

    send_clock_factor: int
    reduction_ratio: int

    @property
    def cycle_ns(self) -> int:
        """Time between two frames."""
        return join_cycle(self.send_clock_factor, self.reduction_ratio)


def auto_mac(farm: str, station: str, salt: int = 0) -> bytes:
    """A stable, locally administered address (IEEE 802-2014 clause 8.4): ``02`` and 40 bits of a digest."""
    digest = hashlib.sha256(f"{farm}\0{station}\0{salt}".encode()).digest()
    return b"\x02" + digest[:5]


def clock_of(controller: ControllerSection, cycle_ns: int | None = None) -> Clock:
    """The send clock and ratio for a drive; ``cycle_ns`` is the drive's own wish.

    Raises ValueError with a sentence when cycle, factor and ratio do not fit each other.
    """
    factor: int | None = controller.send_clock_factor
    # a drive's own cycle takes the send clock, which all drives of a controller share, and a ratio of its own
    ratio: int | None = controller.reduction_ratio if cycle_ns is None else None
    wanted = controller.cycle_ns if cycle_ns is None else cycle_ns
    if factor is not None and ratio is not None:
        made = join_cycle(factor, ratio)
        if wanted not in {None, made}:
            wish = format_duration(wanted or 0)
            raise ValueError(f"factor {factor} and ratio {ratio} make {format_duration(made)}, not {wish}")
    elif factor is not None:
        ratio = _quotient(wanted or DEFAULT_CYCLE_NS, factor)
    elif ratio is not None:
        factor = _quotient(wanted, ratio) if wanted is not None else USUAL_FACTOR
    else:
        factor, ratio = split_cycle(wanted or DEFAULT_CYCLE_NS)
    if (wrong := check_clock(factor, ratio)) is not None:
        raise ValueError(wrong)
    return Clock(factor, ratio)


def own_cycle_ns(group: DriveGroup, controller: ControllerSection | None, model: ModelFacts | None) -> int | None:
    """The cycle of a group's drives where it is not the controller's.

    A file that names no cycle at all means the usual one, or a model's slowest where that is faster.
    """
    if group.cycle_ns is not None or controller is None or model is None or group.limits != "strict":
        return group.cycle_ns
    if controller.cycle_ns or controller.send_clock_factor or controller.reduction_ratio:
        return None
    return model.max_cycle_ns if 0 < model.max_cycle_ns < DEFAULT_CYCLE_NS else None


def _quotient(cycle_ns: int, part: int) -> int:
    whole, rest = divmod(cycle_ns, join_cycle(part, 1))
    if rest or not whole:
        raise ValueError(f"{format_duration(cycle_ns)} is no multiple of {format_duration(join_cycle(part, 1))}")
    return whole


def controller_mac(sections: FarmSections) -> bytes | None:
    """The controller's MAC address; None where it uses an interface's own, or where there is no controller."""
    controller = sections.controller
    if controller is None:
        return None
    if isinstance(controller.mac, bytes):
        return controller.mac
    if controller.mac is None and controller.interface is not None:
        return None
    return auto_mac(sections.farm or "", f"controller:{controller.name}")


# --- expansion --------------------------------------------------------------------------------------------------


def expand_sections(sections: FarmSections, known: Known) -> Iterator[DriveConfig]:
    """The drives in the file's order.  What :func:`check` found wrong is left as it is counted."""
    farm = sections.farm or ""
    taken = {mac for group in sections.drives for mac in _explicit_macs(group)}
    own = controller_mac(sections)
    if own is not None:
        taken.add(own)
    tried: dict[str, int] = {}
    real_link = sections.link is not None and not isinstance(sections.link, MemoryLink)
    index = 0
    for number, group in enumerate(sections.drives):
        model = known.model(group.model)
        for step in range(group.count):
            name = expand_name(group.name, group.start + step)
            yield DriveConfig(
                index=index,
                group=number,
                name=name,
                model=model.name if model is not None else group.model,
                mac=_mac(farm, group, name, step, taken, tried),
                ip=_ip(group, step),
                gateway=group.gateway,
                load=group.load,
                motor=group.motor,
                machine=group.machine,
                strict=group.limits == "strict",
                identity=group.identity,
                params=group.params,
                impair=tuple(group.impair),
                telegram=group.telegram,
                cycle_ns=own_cycle_ns(group, sections.controller, model),
                hello=group.hello,
                motion_tasks=tuple(drive_task(task) for task in group.motion_tasks),
                behaviour=group.behaviour,
                realism=group.realism,
                realism_by_source=real_link and group.limits == "strict",
                listed=model.described if model is not None and model.name in known.listed else None,
            )
            index += 1


def _explicit_macs(group: DriveGroup) -> Iterator[bytes]:
    if isinstance(group.mac, bytes):
        first = mac_to_int(group.mac)
        for value in range(first, min(first + group.count, 1 << 48)):
            yield mac_from_int(value)


def _mac(farm: str, group: DriveGroup, name: str, step: int, taken: set[bytes], tried: dict[str, int]) -> bytes:
    """``tried``: salts that each name has used up, so that a name given thousands of times costs no search each."""
    if isinstance(group.mac, bytes):
        return mac_from_int((mac_to_int(group.mac) + step) % (1 << 48))
    salt = tried.get(name, 0)
    while (mac := auto_mac(farm, name, salt)) in taken:
        salt += 1
    tried[name] = salt + 1
    taken.add(mac)
    return mac


def _ip(group: DriveGroup, step: int) -> IPv4Interface | None:
    if group.ip is None:
        return None
    return IPv4Interface(((int(group.ip) + step) & 0xFFFF_FFFF, group.ip.network.prefixlen))
