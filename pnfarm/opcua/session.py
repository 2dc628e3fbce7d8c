"""A client's session: what it asks for is made and read first, and what it writes goes to the farm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from asyncua import ua
from asyncua.common.utils import ServiceError
from asyncua.server.internal_session import InternalSession

from pnfarm.opcua.limits import LONGEST_MS, MOST_ITEMS, MOST_OPERATIONS, MOST_QUEUED

if TYPE_CHECKING:
    import asyncio
    from collections.abc import Iterable, Sequence

    from pnfarm.opcua.access import Access
    from pnfarm.opcua.carrier import Carrier
    from pnfarm.opcua.nodes import FarmNodes
    from pnfarm.opcua.points import FarmPoints

__all__ = ["FarmSession"]

_VALUE = ua.AttributeIds.Value
_MAY_WRITE = 1 << ua.AccessLevel.CurrentWrite


class FarmSession(InternalSession):
    """``nodes``, ``points``, ``carrier`` and ``access`` are the server's, and set before a client connects."""

    nodes: FarmNodes
    points: FarmPoints
    carrier: Carrier
    access: Access
    interval_ms: float
    pending: asyncio.Task[None]

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        #: Points that this client wrote: only the first time is an event, for a simulation writes each cycle.
        self._written: set[str] = set()

    @property
    def may_write(self) -> bool:
        """Whether its user may change something."""
        return self.access.may_write(self.user.name)

    async def read(self, params: ua.ReadParameters) -> list[ua.DataValue]:
        """Values of the farm as they are, or were within the interval."""
        asked = _few(params.NodesToRead)
        await self.nodes.prepare([one.NodeId for one in asked])
        await self.nodes.refresh([one.NodeId for one in asked if one.AttributeId == _VALUE])
        found = await super().read(params)
        if self.may_write:
            return found
        return [
            _without_write(value) if one.AttributeId == ua.AttributeIds.UserAccessLevel else value
            for one, value in zip(asked, found, strict=True)
        ]

    async def browse(self, params: ua.BrowseParameters) -> list[ua.BrowseResult]:
        await self.nodes.prepare([one.NodeId for one in _few(params.NodesToBrowse)])
        return await super().browse(params)

    async def browse_next(self, parameters: ua.BrowseNextParameters) -> list[ua.BrowseResult]:
        """Everything was in the first answer."""
        del parameters
        raise ServiceError(ua.StatusCodes.BadNothingToDo)

    async def translate_browsepaths_to_nodeids(self, params: list[ua.BrowsePath]) -> list[ua.BrowsePathResult]:
        for path in _few(params):
            await self.nodes.prepare([path.StartingNode])
            await self.nodes.prepare_names([e.TargetName.Name for e in path.RelativePath.Elements if e.TargetName])
        return await super().translate_browsepaths_to_nodeids(params)

    async def write(self, params: ua.WriteParameters) -> list[ua.StatusCode]:
        """Each value with its own status: ``Good``, or why it is refused."""
        asked = _few(params.NodesToWrite)
        await self.nodes.prepare([one.NodeId for one in asked])
        codes = [self._refusal(one) for one in asked]
        right = [(one, point) for one, code in zip(asked, codes, strict=True)
                 if not code and (point := self.nodes.point(one.NodeId)) is not None]  # fmt: skip
        if right:
            values = [(point, one.Value.Value.Value) for one, point in right]
            who, peer = self.user.name or "loopback", str(self.name[0])
            done = iter(await self.carrier(lambda: self.points.write(values, who, peer, self._written)))
            self.nodes.outdated({one.NodeId for one, _ in right})
            codes = [code or next(done) for code in codes]
        return [ua.StatusCode(getattr(ua.StatusCodes, code)) for code in codes]

    def _refusal(self, one: ua.WriteValue) -> str:
        """Why a value is not even taken to the farm, '' if it is."""
        point = self.nodes.point(one.NodeId)
        if point is None:
            return "BadNodeIdUnknown" if one.NodeId not in self.aspace else "BadNotWritable"
        if not self.may_write:
            return "BadUserAccessDenied"
        if one.AttributeId != _VALUE or not point.writable:
            return "BadNotWritable"
        if one.IndexRange or (one.Value.StatusCode is not None and not one.Value.StatusCode.is_good()):
            return "BadWriteNotSupported"
        given = one.Value.Value
        if given is None or given.is_array or given.Value is None or given.VariantType.name != point.type:
            return "BadTypeMismatch"
        return ""

    async def create_subscription(self, params: ua.CreateSubscriptionParameters, *args: Any, **kwargs: Any) -> Any:
        asked = params.RequestedPublishingInterval
        # what is no number is no more than the shortest
        params.RequestedPublishingInterval = min(asked, LONGEST_MS) if asked > self.interval_ms else self.interval_ms
        return await super().create_subscription(params, *args, **kwargs)

    async def create_monitored_items(self, params: ua.CreateMonitoredItemsParameters) -> list[Any]:
        params.SubscriptionId = self._own(params.SubscriptionId)
        items = _few(params.ItemsToCreate)
        nodes = [item.ItemToMonitor.NodeId for item in items]
        await self.nodes.prepare(nodes)
        await self.nodes.refresh(nodes)
        results: list[Any] = [None] * len(items)
        left = max(0, MOST_ITEMS - self.nodes.items)
        taken: list[int] = []
        for number, item in enumerate(items):
            code = _unmonitored(item, self.nodes.point(item.ItemToMonitor.NodeId) is not None)
            if not code and len(taken) >= left:
                code = "BadTooManyMonitoredItems"
            if code:
                results[number] = ua.MonitoredItemCreateResult(ua.StatusCode(getattr(ua.StatusCodes, code)))
            else:
                taken.append(number)
        params.ItemsToCreate = [items[number] for number in taken]
        made = await super().create_monitored_items(params)
        self.nodes.watch(nodes)
        for number, result in zip(taken, made, strict=True):
            results[number] = result
        return results

    async def modify_monitored_items(self, params: ua.ModifyMonitoredItemsParameters) -> Any:
        params.SubscriptionId = self._own(params.SubscriptionId)
        for item in _few(params.ItemsToModify):
            wanted = item.RequestedParameters
            wanted.QueueSize = min(wanted.QueueSize or 1, MOST_QUEUED)
            if _has_deadband(wanted.Filter):
                raise ServiceError(ua.StatusCodes.BadMonitoredItemFilterUnsupported)
        return await super().modify_monitored_items(params)

    async def set_monitoring_mode(self, params: ua.SetMonitoringModeParameters) -> Any:
        params.SubscriptionId = self._own(params.SubscriptionId)
        return await super().set_monitoring_mode(params)

    async def delete_monitored_items(self, params: ua.DeleteMonitoredItemsParameters) -> Any:
        params.SubscriptionId = self._own(params.SubscriptionId)
        return await super().delete_monitored_items(params)

    def modify_subscription(self, params: ua.ModifySubscriptionParameters) -> Any:
        params.SubscriptionId = self._own(params.SubscriptionId)
        return super().modify_subscription(params)

    async def set_publishing_mode(self, params: ua.SetPublishingModeParameters) -> Any:
        params.SubscriptionIds = [self._own(one) for one in params.SubscriptionIds]
        return await super().set_publishing_mode(params)

    async def delete_subscriptions(self, ids: list[int]) -> Any:
        return await super().delete_subscriptions([self._own(one) for one in ids])

    def publish(self, acks: Iterable[Any] | None = None) -> Any:
        acks = [*(acks or ())]
        for ack in acks:
            ack.SubscriptionId = self._own(ack.SubscriptionId)
        return super().publish(acks)

    def republish(self, params: ua.RepublishParameters) -> Any:
        params.SubscriptionId = self._own(params.SubscriptionId)
        return super().republish(params)

    async def transfer_subscriptions(self, params: Any, callback: Any) -> Any:
        """A client that has lost its session subscribes again."""
        del params, callback
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)

    def _own(self, number: int) -> int:
        """A subscription's number, or that of none for one of another session."""
        found = self.subscription_service.subscriptions.get(number)
        return number if found is not None and found.session_id == self.session_id else 0

    async def call(self, params: list[ua.CallMethodRequest]) -> list[ua.CallMethodResult]:
        """The farm has no methods."""
        code = ua.StatusCode(ua.StatusCodes.BadMethodInvalid)
        return [ua.CallMethodResult(StatusCode_=code) for _ in _few(params)]

    async def history_read(self, params: Any) -> Any:
        """The farm keeps no history."""
        del params
        raise ServiceError(ua.StatusCodes.BadServiceUnsupported)


def _few(asked: Sequence[Any] | None) -> Sequence[Any]:
    if asked is None or not 1 <= len(asked) <= MOST_OPERATIONS:
        raise ServiceError(ua.StatusCodes.BadTooManyOperations if asked else ua.StatusCodes.BadNothingToDo)
    return asked


def _without_write(value: ua.DataValue) -> ua.DataValue:
    if value.Value is None or not isinstance(value.Value.Value, int):
        return value
    return ua.DataValue(ua.Variant(value.Value.Value & ~_MAY_WRITE, value.Value.VariantType))


def _unmonitored(item: ua.MonitoredItemCreateRequest, ours: bool) -> str:
    """Why an item cannot be monitored, '' if it can; of other nodes than the farm's, the server's own state can."""
    if item.ItemToMonitor.AttributeId != _VALUE:
        return "BadAttributeIdInvalid"
    if _has_deadband(item.RequestedParameters.Filter):
        return "BadMonitoredItemFilterUnsupported"
    return "" if ours or item.ItemToMonitor.NodeId.NamespaceIndex == 0 else "BadNodeIdUnknown"


def _has_deadband(asked: Any) -> bool:
    if isinstance(asked, ua.DataChangeFilter):
        return bool(asked.DeadbandType)
    return asked is not None and not (isinstance(asked, ua.ExtensionObject) and asked.TypeId.is_null())
