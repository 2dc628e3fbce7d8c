"""The nodes of a farm in the server's address space, and their values.

Folders and owners are made at the start; an owner's signals, when a client first asks for one of them, so that 500
drives cost nothing.  A value is read from the farm when it is asked for and older than the interval, and again each
interval while somebody has subscribed to it.
"""

from __future__ import annotations

import asyncio
import time
from datetime import UTC, datetime
from typing import TYPE_CHECKING, Any

from asyncua import ua

from pnfarm.opcua.points import GOOD
from pnfarm.opcua.units import engineering_units

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from asyncua import Node, Server
    from asyncua.server.address_space import AttributeValue

    from pnfarm.opcua.carrier import Carrier
    from pnfarm.opcua.points import FarmPoints, Point, Reading

__all__ = ["NAMESPACE", "FarmNodes"]

NAMESPACE = "urn:pnfarm:farm"
#: Values read in one action in the farm's loop.
_AT_ONCE = 200
_VALUE = ua.AttributeIds.Value
_EMPTY = {"Boolean": False, "String": "", "ByteString": b"", "Double": 0.0, "Float": 0.0}


class FarmNodes:
    """``interval_ns``: no value is read from the farm more often.  ``index`` is that of the namespace."""

    def __init__(self, server: Server, index: int, points: FarmPoints, carrier: Carrier, interval_ns: int) -> None:
        self._server = server
        self._index = index
        self._points = points
        self._carrier = carrier
        self._interval = interval_ns / 1e9
        #: Owners without their signals so far.
        self._folded: set[str] = set()
        self._owners: set[str] = set()
        self._known: dict[ua.NodeId, Point] = {}
        self._read_at: dict[ua.NodeId, float] = {}
        #: What clients may have subscribed to.
        self._watched: set[ua.NodeId] = set()
        self._lock = asyncio.Lock()

    async def make(self, farm: str) -> None:
        """``Objects/Farm/<farm>/Drives|Devices|Plant/<owner>``."""
        objects = self._server.get_objects_node()
        root = await self._folder(objects, "/Farm", "Farm")
        root = await self._folder(root, f"/Farm/{farm}", farm)
        folders: dict[str, Node] = {}
        for folder, name, kind in self._points.owners():
            if folder not in folders:
                folders[folder] = await self._folder(root, f"/{folder}", folder)
            made = await folders[folder].add_object(self._id(name), ua.QualifiedName(name, self._index))
            await _describe(made, kind)
            self._folded.add(name)
        self._owners = set(self._folded)

    def point(self, node: ua.NodeId) -> Point | None:
        """What a node stands for, once it is made."""
        return self._known.get(node)

    async def prepare(self, nodes: Iterable[ua.NodeId]) -> None:
        """Make what is asked for and is not there yet."""
        names = [
            node.Identifier
            for node in nodes
            if node.NamespaceIndex == self._index and isinstance(node.Identifier, str) and node not in self._known
        ]
        if not names:
            return
        async with self._lock:
            found = {name: owner for name in names if (owner := self._owner_of(name)) is not None}
            for owner in dict.fromkeys(found.values()):
                if owner in self._folded:
                    await self._add(owner, self._points.points_of(owner))
                    self._folded.discard(owner)
            bits = [(o, n[len(o) + 1 :]) for n, o in found.items() if n != o and self._id(n) not in self._known]
            for owner, bit in bits:
                if (point := self._points.bit(owner, bit)) is not None:
                    await self._add(owner, [point])

    async def prepare_names(self, names: Iterable[str]) -> None:
        """The same for owners by their names."""
        await self.prepare([self._id(name) for name in names if name in self._folded])

    def _owner_of(self, name: str) -> str | None:
        return next((each for each in _beginnings(name) if each in self._owners), None)

    async def _add(self, owner: str, points: Sequence[Point]) -> None:
        """Nodes of an owner's signals, with their units; other clients are served before the next owner's."""
        items = []
        # one node alone can have a name: that of a drive, where a signal of another one would have the same
        points = [point for point in points if point.name not in self._owners]
        for point in points:
            kind = ua.VariantType[point.type]
            empty = ua.Variant(_EMPTY.get(point.type, 0), kind)
            items.append(self._item(owner, point.name, ua.QualifiedName(point.signal, self._index), empty, point))
            if point.unit:
                units = ua.Variant(engineering_units(point.unit), ua.VariantType.ExtensionObject)
                name = ua.QualifiedName("EngineeringUnits", 0)
                items.append(self._item(point.name, f"{point.name}/EngineeringUnits", name, units))
        for result in await self._server.iserver.isession.add_nodes(items):
            result.StatusCode.check()
        self._known.update({self._id(point.name): point for point in points})
        await asyncio.sleep(0)

    def _item(
        self, parent: str, name: str, browse: ua.QualifiedName, value: ua.Variant, point: Point | None = None
    ) -> ua.AddNodesItem:
        """A variable of a point, or a property with the units of one."""
        access = ua.AccessLevel.CurrentRead.mask
        if point is not None and point.writable:
            access |= ua.AccessLevel.CurrentWrite.mask
        item, has = ua.AddNodesItem(), ua.VariableAttributes()
        item.RequestedNewNodeId, item.ParentNodeId, item.BrowseName = self._id(name), self._id(parent), browse
        item.NodeClass = ua.NodeClass.Variable
        kind = ua.ObjectIds.BaseDataVariableType if point else ua.ObjectIds.PropertyType
        item.TypeDefinition = ua.NodeId(kind)
        item.ReferenceTypeId = ua.NodeId(ua.ObjectIds.HasComponent if point else ua.ObjectIds.HasProperty)
        has.DisplayName = ua.LocalizedText(browse.Name)
        has.Description = ua.LocalizedText(point.doc if point else "")
        has.Value, has.ValueRank, has.ArrayDimensions = value, ua.ValueRank.Scalar, None
        has.DataType = ua.NodeId(value.VariantType.value if point else ua.ObjectIds.EUInformation)
        has.AccessLevel = has.UserAccessLevel = access
        has.WriteMask, has.UserWriteMask, has.Historizing = 0, 0, False
        item.NodeAttributes = has
        return item

    async def refresh(self, nodes: Iterable[ua.NodeId]) -> None:
        """Read the values of those that are older than the interval, and report changes to subscribers."""
        late = time.monotonic() - self._interval
        asked = [n for n in dict.fromkeys(nodes) if n in self._known and self._read_at.get(n, -1e9) <= late]
        for begin in range(0, len(asked), _AT_ONCE):
            part = asked[begin : begin + _AT_ONCE]
            names = [self._known[node].name for node in part]
            readings = await self._carrier(lambda names=names: self._points.read(names))  # type: ignore[misc]
            read_at, stamp = time.monotonic(), datetime.now(UTC)
            for node, reading in zip(part, readings, strict=True):
                self._read_at[node] = read_at
                await self._store(node, reading, stamp)

    async def _store(self, node: ua.NodeId, reading: Reading, stamp: datetime) -> None:
        value, status = reading
        kind = ua.VariantType[self._known[node].type]
        good = status == GOOD
        fresh = ua.DataValue(
            ua.Variant(value, kind) if good else ua.Variant(None, ua.VariantType.Null),
            StatusCode=ua.StatusCode(getattr(ua.StatusCodes, status)),
            SourceTimestamp=stamp,
            ServerTimestamp=stamp,
        )
        holder = self._holder(node)
        if _same(holder.value, fresh):
            holder.value = fresh
        else:
            await self._server.iserver.write_attribute_value(node, fresh)

    def outdated(self, nodes: Iterable[ua.NodeId]) -> None:
        """Their values were changed: the next reader gets the new ones."""
        for node in nodes:
            self._read_at.pop(node, None)

    def watch(self, nodes: Iterable[ua.NodeId]) -> None:
        """Clients may have subscribed to these."""
        aspace = self._server.iserver.aspace
        self._watched.update(n for n in nodes if (made := aspace.get(n)) is not None and _VALUE in made.attributes)

    @property
    def items(self) -> int:
        """The monitored items of all clients; forgets what no client watches any more."""
        counts = {node: len(self._holder(node).datachange_callbacks) for node in self._watched}
        self._watched = {node for node, count in counts.items() if count}
        return sum(counts.values())

    async def run(self) -> None:
        """Read what clients have subscribed to, each interval."""
        while True:
            if self.items:
                await self.refresh(list(self._watched))
            await asyncio.sleep(self._interval)

    def _holder(self, node: ua.NodeId) -> AttributeValue:
        return self._server.iserver.aspace[node].attributes[_VALUE]

    async def _folder(self, parent: Node, name: str, shown: str) -> Node:
        return await parent.add_folder(self._id(name), ua.QualifiedName(shown, self._index))

    def _id(self, name: str) -> ua.NodeId:
        return ua.NodeId(name, self._index)


async def _describe(node: Node, text: str) -> None:
    await node.write_attribute(ua.AttributeIds.Description, ua.DataValue(ua.LocalizedText(text)))


def _beginnings(name: str) -> Sequence[str]:
    """The text up to each of its dots, the longest first."""
    parts = name.split(".")[:8]
    return [".".join(parts[:count]) for count in range(len(parts), 0, -1)]


def _same(old: ua.DataValue | None, new: ua.DataValue) -> bool:
    if old is None or old.StatusCode != new.StatusCode or old.Value is None or new.Value is None:
        return False
    before: Any = old.Value.Value
    after: Any = new.Value.Value
    # a number that is none is like itself
    return bool(before == after or (before != before and after != after))  # noqa: PLR0124
