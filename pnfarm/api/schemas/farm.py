"""The type of a whole farm: its engine, its lines, its standing, its drives."""

from __future__ import annotations

from pydantic import Field

from pnfarm.api.schemas.drive import Drive  # noqa: TC001 - pydantic reads the annotations of fields
from pnfarm.web.bodies import Schema

__all__ = ["Engine", "FarmView", "LineView"]


class Engine(Schema):
    cycles: int
    overruns: int
    lateness_max_seconds: float
    frames_sent: int
    frames_received: int
    frames_unknown: int
    frames_malformed: int
    send_errors: int
    events_lost: int


class LineView(Schema):
    """A serial line that all drives on one bus share."""

    name: str = Field(description="The name of the bus.")
    way: str = Field(description="pty, port, connect or listen.")
    where: str = Field(description="What the other end connects to.")
    up: bool = Field(description="Whether the line is connected, as far as the farm can detect it.")
    baud: int
    telegrams_received: int
    telegrams_sent: int
    octets_received: int
    octets_sent: int
    octets_lost: dict[str, int] = Field(description="Octets that could not be sent, by reason.")
    interruptions: dict[str, int] = Field(
        description="How often the connection broke or could not be opened, by reason."
    )
    dropped: dict[str, int] = Field(
        description="Received data that are not telegrams, by reason; garbage counts octets."
    )
    counts: dict[str, int] = Field(description="Requests of some kinds: repeated, diagnosis, refused.")
    answers_withheld: int = Field(description="Answers that would have begun later than allowed.")
    reply_seconds_mean: float | None = Field(description="From a request's last octet to its answer, in this process.")


class ShardView(Schema):
    """Which part of a farm these drives are."""

    index: int = Field(description="From 1.")
    count: int


class Other(Schema):
    host: str
    shard: str = Field(description="Empty for the whole farm.")


class StandingView(Schema):
    """The database of the drives' memory, and the lease of these drives in it."""

    memory: str = Field(description="The database, without password.")
    memory_up: bool = Field(description="Whether the drives can save.")
    memory_reason: str = Field(description="Why not; empty if it can.")
    lease: str = Field(description="held, lost or waiting: without it being held, the drives are mute.")
    renewed_seconds_ago: float | None
    ttl_seconds: float | None = Field(description="Time without a renewal after which others may run the drives.")
    mute_after_seconds: float | None = Field(description="Time without a renewal after which the drives are mute.")
    held_by: Other | None = Field(description="Who runs the drives instead.")


class FarmView(Schema):
    farm: str
    shard: ShardView | None = Field(description="Null where the whole farm runs here.")
    standing: StandingView | None = Field(description="Null where the memory is in a folder, or there is none.")
    link: str
    lines: list[LineView]
    engine: Engine
    drives: tuple[Drive, ...]
