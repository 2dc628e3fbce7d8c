"""The type of what a drive's controller did."""

from __future__ import annotations

from pydantic import Field

from pnfarm.web.bodies import Schema

__all__ = ["ControllerView"]


class Bucket(Schema):
    up_to_seconds: float | None = Field(description="Upper bound; null for the rest.")
    count: int


class Distribution(Schema):
    mean_seconds: float | None
    buckets: list[Bucket] = Field(description="Buckets that are not empty.")


class ByCause(Schema):
    controller: int
    farm: int = Field(description="While the farm itself was later than its budget.")


class LateFrame(Schema):
    seconds_ago: float
    late_seconds: float
    engine_late_seconds: float = Field(description="How late the farm's engine had been since the frame before.")


class ChangedBit(Schema):
    bit: int
    name: str
    value: int
    after_seconds: float


class Reaction(Schema):
    code: str
    kind: str = Field(description="What was injected; none if nothing was.")
    seconds_ago: float
    reaction_seconds: float | None = Field(description="Until the controller withdrew the enable.")
    acknowledged_seconds: float | None
    stw1: list[ChangedBit] = Field(description="First change of each bit of STW1 since the fault.")


class StartUpView(Schema):
    controller: str | None = Field(description="Its station name; null before it asked for a connection.")
    attempts: int = Field(description="Connects, also refused ones.")
    complete: bool
    after_loss_seconds: float | None = Field(description="From the loss of the connection before it to data exchange.")
    phases: dict[str, float] = Field(
        description="Seconds for identify, address, connect, parameters, ready, data, each from the one before, the "
        "first one from the loss; a phase that the controller left out is not there."
    )


class SignOfLife(Schema):
    monitored: bool
    errors: int
    tolerance: int


class ControllerView(Schema):
    """What a drive's controller did, seen from the drive, since the farm started."""

    drive: str
    cycle_seconds: float | None
    intervals: Distribution
    jitter: Distribution = Field(description="Deviation of the intervals from the agreed cycle.")
    missed_updates: int
    late_frames: ByCause = Field(description="Frames more than half a cycle late.")
    last_late_frame: LateFrame | None = Field(description="In the present connection.")
    watchdog_expirations: ByCause
    attempts: int = Field(description="Connects, also refused ones.")
    refused: int
    connects: int
    start_ups: list[StartUpView] = Field(description="The newest ones, oldest first.")
    faults: list[Reaction] = Field(description="The newest fault situations, oldest first.")
    sign_of_life: SignOfLife | None = Field(description="Null without STW2 in the telegram.")
