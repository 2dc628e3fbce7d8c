"""Drives at the hub: the list of all, and a drive's own paths at the shard that has it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fastapi import FastAPI

from pnfarm.api.app import add_one_drive
from pnfarm.hub.hosts.passing import Passing
from pnfarm.hub.merging import joined_engine, unreachable_drive, with_fault_ids

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pnfarm.hub.hub import Hub
    from pnfarm.hub.shards import Shard

__all__ = ["HubDrives"]


class HubDrives(Passing):
    """As :class:`~pnfarm.api.paths.drives.DrivesHost`; what is below a drive is passed on."""

    def __init__(self, hub: Hub) -> None:
        super().__init__(hub, "drives/{name}", hub.shards.owner)

    async def listed(self) -> dict[str, Any]:
        """``GET drives`` of all shards; drives of those that are away as they were seen last."""
        hub = self._hub
        answers = await hub.ask_all("GET", "drives", self._take)
        partial = hub.partial(answers)
        missing, fresh = hub.missing(answers), answers.good
        conflicts = hub.shards.conflicts()
        drives = []
        for name in hub.shards.names:
            owners = [shard for shard in hub.shards if name in shard.drives]
            shard = next(
                (one for one in owners if one in fresh), next((one for one in owners if one.asked), owners[-1])
            )
            drive = with_fault_ids(shard, shard.drives[name])
            if shard not in fresh:
                drive = unreachable_drive(drive, missing.get(shard, shard.told()))
            elif name in conflicts:
                drive = {**drive, "claimed_by": [one.label for one in conflicts[name]]}
            drives.append(drive)
        views = [shard.view for shard in fresh]
        return {
            "farm": hub.shards.farm,
            # all of them; each shard reports its own
            "shard": None,
            "standing": None,
            "link": "+".join(dict.fromkeys(str(view["link"]) for view in views)) or "unreachable",
            "lines": [
                {**line, "shard": shard.label} if len(hub.shards) > 1 else line
                for shard in hub.shards
                if shard in fresh
                for line in shard.view["lines"]
            ],
            "engine": joined_engine(view["engine"] for view in views),
            "drives": drives,
            **partial,
        }

    def _take(self, shard: Shard, answer: dict[str, Any]) -> None:
        # what is put together below
        joined_engine([answer["engine"]])
        str(answer["link"])
        for drive in answer["drives"]:
            with_fault_ids(shard, drive)
        self._hub.shards.take(shard, answer)

    def add_drive(self, app: FastAPI) -> None:
        """What is below a drive."""
        farm = FastAPI()
        # no station answers there
        nobody: Any = None
        add_one_drive(farm, nobody, nobody)
        self.add(app, farm)

    def shown(self, shard: Shard, view: Mapping[str, Any]) -> dict[str, Any]:
        """With its events by the hub's clock."""
        found = {**super().shown(shard, view), "shard": shard.label}
        if "events" in view:
            found["events"] = [self._hub.entry(shard, entry) for entry in view["events"]]
        return found
