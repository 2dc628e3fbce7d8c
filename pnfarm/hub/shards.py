"""The shards that a hub knows, and which of them has which drive: a table without a clock, a socket or a task."""

from __future__ import annotations

import re
from collections import Counter
from contextlib import contextmanager
from dataclasses import dataclass, field
from http import HTTPStatus
from typing import TYPE_CHECKING, Any, NamedTuple

from pnfarm.drives.catalogue import model as model_by_name
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.hub.clocks import ClockOffset
from pnfarm.hub.states import TRANSITIONS, ShardEvent, ShardState
from pnfarm.vocabulary.quoting import did_you_mean, shown
from pnfarm.web.errors import NotFoundError, RequestError

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator, Mapping

__all__ = ["KEEP_NS", "MOST_SHARDS", "OWN_FAULT", "AwayError", "Shard", "Shards", "no_steps", "understood"]

#: How long a shard that left DNS and does not answer is shown as unreachable.
KEEP_NS = 600_000_000_000
#: More than a plant has machines; more addresses behind a name are not asked.
MOST_SHARDS = 256
#: Ids of faults that a farm makes up itself.
OWN_FAULT = re.compile(r"fault-[0-9]+")
#: What a line is called, and where it is.
_LINE = ("name", "way", "where")


class AwayError(EnvironmentError_):
    """A shard does not answer; ``event`` is what that says about it."""

    def __init__(self, sentence: str, event: ShardEvent = ShardEvent.REFUSED, slug: str = "away") -> None:
        super().__init__(sentence)
        self.event = event
        self.slug = slug


@dataclass(slots=True, eq=False)
class Shard:
    """One farm behind one URL.  ``given``: by its URL, so that it is never forgotten; else found by a name."""

    url: str
    given: bool
    state: ShardState = ShardState.UNKNOWN
    #: Why it is not up, and since when: the hub's clock, and seconds since the epoch.
    reason: str = "it has not answered yet"
    since_ns: int = 0
    since_wall: float = 0.0
    clock: ClockOffset = field(default_factory=ClockOffset)
    #: What its clock answered last: farm, pnfarm, instance ...
    about: dict[str, Any] = field(default_factory=dict)
    #: Its drives by name as they were seen last, and the rest of that answer.
    drives: dict[str, dict[str, Any]] = field(default_factory=dict)
    view: dict[str, Any] = field(default_factory=dict)
    #: Its devices by name, and what `model:` means each by; the same for its whole run.
    devices: dict[str, tuple[str, ...]] = field(default_factory=dict)
    #: The present name of station of each.
    device_names: dict[str, str] = field(default_factory=dict)
    #: Whether stations may have other names than those that were read.
    may_be_renamed: bool = False
    #: The models of its plant, which have signals, too, and the kind of each.
    models: dict[str, str] = field(default_factory=dict)
    #: Its faults by id as they were seen last.
    faults: dict[str, dict[str, Any]] = field(default_factory=dict)
    errors: Counter[str] = field(default_factory=Counter)
    #: When its address left the name's answer; None: it is there.
    left_ns: int | None = None
    #: What is odd about it, though it works.
    notes: list[str] = field(default_factory=list)

    @property
    def label(self) -> str:
        """``HOST:PORT``."""
        return self.url.partition("://")[2]

    @property
    def instance(self) -> str:
        return str(self.about.get("instance", ""))

    @property
    def asked(self) -> bool:
        """Whether requests go to it."""
        return self.state in {ShardState.UP, ShardState.SILENT}

    def fault_id(self, own: str) -> str:
        """What a fault of its is called at the hub: an id that the shard made up is the same on others."""
        return f"{own}@{self.label}" if OWN_FAULT.fullmatch(own) else own

    def has_own_name(self, name: str) -> bool:
        """Whether a station has the name on its bus that it has in the farm file."""
        view = self.drives.get(name)
        return (self.device_names.get(name) if view is None else view.get("station_name")) == name

    def away(self) -> AwayError:
        """Why it cannot be asked."""
        return AwayError(f"{self.label} does not answer: {self.reason}")

    def told(self) -> dict[str, Any]:
        """An entry of ``unreachable``."""
        return {"shard": self.label, "reason": self.reason, "since": self.since_wall}


@contextmanager
def understood(shard: Shard, what: str = "does not answer") -> Iterator[None]:
    """What a shard sent is used here: raises :class:`AwayError` where it is not as a farm's."""
    try:
        yield
    except KeyError as exc:
        raise AwayError(f"{shard.label} {what} as a farm does: {exc.args[0]} is missing", slug="garbage") from exc
    except (TypeError, ValueError, AttributeError, IndexError, OverflowError) as exc:
        raise AwayError(f"{shard.label} {what} as a farm does: {str(exc)[:200]}", slug="garbage") from exc


class KnownDrive(NamedTuple):
    """A drive's names, and those of its model."""

    names: tuple[str, ...]
    models: tuple[str, ...]


def no_steps(path: str) -> None:
    """Raises :class:`NotFoundError` for a name or path that an HTTP client takes for steps to another path."""
    if any(part in {".", ".."} for part in path.split("/")):
        raise NotFoundError(f"there is nothing called {shown(path)}")


_DIGITS = re.compile(r"([0-9]+)")


def natural(name: str) -> tuple[Any, ...]:
    """Orders ``axis-2`` before ``axis-10``, whatever the shards are."""
    parts = _DIGITS.split(name[:250])
    # the odd ones are those that it splits at
    return tuple((1, int(part), part) if place % 2 else (0, 0, part) for place, part in enumerate(parts) if part)


class Shards:
    """See the module's docstring; ``now`` is the hub's clock, ns, ``wall`` seconds since the epoch."""

    def __init__(self) -> None:
        self._all: dict[str, Shard] = {}
        self._owners: dict[str, list[Shard]] = {}
        self._device_owners: dict[str, list[Shard]] = {}
        #: Every device, in natural order of the names, and what `model:` means it by.
        self.devices: dict[str, tuple[str, ...]] = {}
        self._order: tuple[str, ...] = ()
        #: Counts changes of the list of drives.
        self.layout = 0

    def __iter__(self) -> Any:
        return iter(list(self._all.values()))

    def __len__(self) -> int:
        return len(self._all)

    # -- which there are

    def give(self, url: str) -> Shard:
        """One by its URL."""
        return self._all.setdefault(url, Shard(url, given=True))

    def found(self, urls: Iterable[str], now: int) -> None:
        """The whole answer of a name: new ones are known from now on, others have left."""
        wanted = dict.fromkeys(urls)
        for url in wanted:
            if url in self._all:
                self._all[url].left_ns = None
            elif len(self._all) < MOST_SHARDS:
                self._all[url] = Shard(url, given=False, since_ns=now)
        for shard in self._all.values():
            if not shard.given and shard.url not in wanted and shard.left_ns is None:
                shard.left_ns = now

    def forget(self, now: int) -> list[Shard]:
        """Take those out that left long ago, or whose drives are elsewhere by now; returns them."""
        gone = []
        for shard in list(self._all.values()):
            if shard.left_ns is None or shard.asked:
                continue
            owners = [self._owners.get(name, []) for name in shard.drives]
            owners += [self._device_owners.get(name, []) for name in (*shard.devices, *shard.models)]
            # of one that never answered nothing is known
            elsewhere = all(any(one is not shard and one.asked for one in found) for found in owners)
            if elsewhere or now - shard.left_ns > KEEP_NS:
                del self._all[shard.url]
                gone.append(shard)
        if gone:
            self._index()
        return gone

    # -- what they say

    def note(self, shard: Shard, event: ShardEvent, reason: str, now: int, wall: float) -> bool:
        """What came of the last question; the one place that writes a shard's state.  Whether it came or went."""
        before, after = shard.state, TRANSITIONS[shard.state, event]
        was_asked = shard.asked
        shard.state = after
        if after is not ShardState.UP:
            shard.reason = reason
        went = after is ShardState.AWAY and before is not ShardState.AWAY
        if went or (shard.asked and not was_asked):
            shard.since_ns, shard.since_wall = now, wall
        if was_asked is not shard.asked:
            self._index()
        return was_asked is not shard.asked

    def take(
        self,
        shard: Shard,
        view: Mapping[str, Any],
        devices: Iterable[Mapping[str, Any]] | None = None,
        models: Iterable[Mapping[str, Any]] = (),
    ) -> None:
        """Its answer to ``GET drives``, and where it was asked for them its ``devices`` and ``models`` of the plant.

        Raises :class:`AwayError`, with nothing taken, for what no farm answers.
        """
        with understood(shard):
            drives = {str(one["name"]): {**one, "model": str(one["model"])} for one in view["drives"]}
            rest = {key: value for key, value in view.items() if key != "drives"}
            lines = [{**line, **{key: str(line[key]) for key in _LINE}} for line in view["lines"]]
            rows = {str(one["name"]): one for one in devices or ()}
            kinds = {str(one["name"]): str(one["kind"]) for one in models}
            meant = {name: tuple(map(str, one["models"])) for name, one in rows.items()}
            names = {name: str(one.get("station_name", name)) for name, one in rows.items()}
        same = devices is None and drives.keys() == shard.drives.keys()
        if devices is not None:
            shard.models, shard.devices, shard.device_names = kinds, meant, names
        shard.drives = drives
        shard.view = {**rest, "lines": lines}
        if not same:
            self._index()

    def _index(self) -> None:
        owners: dict[str, list[Shard]] = {}
        device_owners: dict[str, list[Shard]] = {}
        for shard in self._all.values():
            for name in shard.drives:
                owners.setdefault(name, []).append(shard)
            for name in (*shard.devices, *shard.models):
                device_owners.setdefault(name, []).append(shard)
        self._owners, self._device_owners = _present(owners), _present(device_owners)
        self.devices = {
            name: found[0].devices[name]
            for name, found in sorted(device_owners.items(), key=lambda one: natural(one[0]))
            if name in found[0].devices
        }
        order = tuple(sorted(self._owners, key=natural))
        if order != self._order:
            self._order = order
            self.layout += 1

    # -- who has what

    @property
    def names(self) -> tuple[str, ...]:
        """Every drive, in natural order of the names."""
        return self._order

    @property
    def stations(self) -> tuple[str, ...]:
        """Every drive, then every device."""
        return (*self._order, *self.devices)

    @property
    def views(self) -> dict[str, dict[str, Any]]:
        """Every drive as it was seen last, of several shards that claim it at the first of them."""
        found: dict[str, dict[str, Any]] = {}
        for shard in self._all.values():
            for name, view in shard.drives.items():
                found.setdefault(name, view)
        return {name: found[name] for name in self._order}

    @property
    def known_as(self) -> dict[str, KnownDrive]:
        """Every drive and device, as globs see it."""
        drives = {name: KnownDrive(_names(view), _models(str(view["model"]))) for name, view in self.views.items()}
        present = {name: one for shard in self._all.values() for name, one in shard.device_names.items()}
        devices = {
            name: KnownDrive(tuple(dict.fromkeys((name, present.get(name) or name))), models)
            for name, models in self.devices.items()
        }
        return {**drives, **devices}

    @property
    def traced_as(self) -> dict[str, KnownDrive]:
        """Every drive, device and model of a plant, as globs see it."""
        models = {name: kind for shard in self._all.values() for name, kind in shard.models.items()}
        return {**self.known_as, **{name: KnownDrive((name,), (kind,)) for name, kind in models.items()}}

    def own_name(self, name: str) -> str:
        """A drive's name in its farm file.  Raises as :meth:`known`."""
        return name if name in self.known(name).drives else self._renamed(name)

    @property
    def farm(self) -> str:
        """The farm's name; of several farms all names."""
        return " + ".join(dict.fromkeys(str(one.about["farm"]) for one in self._all.values() if one.about)) or "hub"

    @property
    def unreachable(self) -> list[Shard]:
        """Those that cannot be asked."""
        return [shard for shard in self._all.values() if not shard.asked]

    @property
    def reachable(self) -> list[Shard]:
        return [shard for shard in self._all.values() if shard.asked]

    def conflicts(self) -> dict[str, list[Shard]]:
        """Drives that several shards claim."""
        return {name: found for name, found in self._owners.items() if len(found) > 1}

    def known(self, name: str) -> Shard:
        """The shard that has a drive, also one that is away.

        Raises :class:`NotFoundError`, or :class:`RequestError` (409) for a drive that two of them claim.
        """
        return self._one_of("drive", name if name in self._owners else self._renamed(name), self._owners)

    def _one_of(self, what: str, name: str, owners: Mapping[str, list[Shard]]) -> Shard:
        found = owners.get(name, [])
        if not found:
            if self.unreachable or not self._all:
                away = ", ".join(shard.label for shard in self.unreachable) or "no shard is known"
                raise AwayError(f"no shard that answers has a {what} {shown(name)}; not asked: {away}")
            raise NotFoundError(f"there is no {what} {shown(name)}{did_you_mean(name, owners)}")
        if len(found) > 1:
            claims = " and ".join(shard.label for shard in found)
            raise RequestError(
                f"{name} is claimed by {claims}: stop one of them, so that it is clear which is meant",
                status=HTTPStatus.CONFLICT,
            )
        return found[0]

    @property
    def with_signals(self) -> Collection[str]:
        """Every device and every model of a plant."""
        return self._device_owners.keys()

    def known_device(self, name: str) -> Shard:
        """The shard that has a device or a model of the plant; as :meth:`known`."""
        return self._one_of("device", self._own_device(name), self._device_owners)

    def known_station(self, name: str) -> Shard:
        """The shard that has a drive or a device; as :meth:`known`."""
        is_device = name not in self._owners and self._own_device(name) in self._device_owners
        return self.known_device(name) if is_device else self.known(name)

    def device_owner(self, name: str) -> Shard:
        """The shard that has a device; raises as :meth:`owner`."""
        return self._asked(name, self.known_device(name))

    def station_owner(self, name: str) -> Shard:
        """The shard that has a drive or a device; raises as :meth:`owner`."""
        return self._asked(name, self.known_station(name))

    def owner(self, name: str) -> Shard:
        """As :meth:`known`; raises :class:`AwayError` for one that cannot be asked."""
        return self._asked(name, self.known(name))

    def _asked(self, name: str, found: Shard) -> Shard:
        if not found.asked:
            raise AwayError(f"{name} is unreachable: {found.away()}")
        return found

    def _renamed(self, name: str) -> str:
        """A drive by its present name of station, as a farm takes it, too."""
        for shard in self._all.values():
            for own, view in shard.drives.items():
                if view.get("station_name") == name:
                    return own
        return name

    def _own_device(self, name: str) -> str:
        """As :meth:`_renamed`, of a device."""
        if name not in self._device_owners:
            for shard in self._all.values():
                for own, present in shard.device_names.items():
                    if present == name:
                        return own
        return name


def _present(owners: Mapping[str, list[Shard]]) -> dict[str, list[Shard]]:
    """One that is away has lost what it had to one that has it now."""
    return {name: [one for one in found if one.asked] or found[-1:] for name, found in owners.items()}


def _names(view: Mapping[str, Any]) -> tuple[str, ...]:
    own, station = str(view["name"]), view.get("station_name")
    return (own, str(station)) if station and station != own else (own,)


def _models(name: str) -> tuple[str, ...]:
    try:
        found = model_by_name(name)
    except ConfigError:
        # of a shard with a newer version
        return (name,)
    return (found.name, *found.aliases)
