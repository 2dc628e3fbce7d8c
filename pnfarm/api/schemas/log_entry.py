"""The type of an entry of the event log, in a drive's answer and in the event stream."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["LogEntry"]


class LogEntry(BaseModel):
    """An entry of the event log: the members named here, and those of its event.

    `repeated` is how often it happened since the last entry with this event, where a controller tries again and again.
    """

    model_config = ConfigDict(extra="allow")

    sequence: int = Field(description="Counts from 1, without gaps over the whole farm; anew with each run.")
    time: float = Field(description="Seconds since the epoch.")
    farm_seconds: float = Field(description="The farm's clock.")
    drive: str = Field(description="Empty for the farm itself.")
    event: str = Field(description="What happened, in a few lower-case words.")
