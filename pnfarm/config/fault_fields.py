"""The fields that every injected fault has: in a farm file's ``impair:``, a scenario, a request, on a command line."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, PlainSerializer, PlainValidator, WithJsonSchema

from pnfarm.config.section import Section
from pnfarm.vocabulary.conditions import CONDITION_SCHEMA, read_condition
from pnfarm.vocabulary.durations import DURATION_PATTERN, format_duration, read_duration
from pnfarm.vocabulary.names import PATTERN
from pnfarm.vocabulary.rates import RATE_PATTERN, SHARE_PATTERN, format_rate, format_share, read_rate, read_share
from pnfarm.wire.direction import Directions

__all__ = ["MOST_COUNT", "FaultFields"]

#: With the longest cycle, this many still fit the table's time.
MOST_COUNT = (1 << 32) - 1

Duration = Annotated[
    int,
    PlainValidator(read_duration),
    PlainSerializer(format_duration, return_type=str, when_used="unless-none"),
    WithJsonSchema({"type": "string", "pattern": DURATION_PATTERN}),
]
Share = Annotated[
    float,
    PlainValidator(read_share),
    PlainSerializer(format_share, return_type=str, when_used="unless-none"),
    WithJsonSchema({"type": "string", "pattern": SHARE_PATTERN}),
]
Rate = Annotated[
    tuple[float, str],
    PlainValidator(read_rate),
    PlainSerializer(format_rate, return_type=str, when_used="unless-none"),
    WithJsonSchema({"type": "string", "pattern": RATE_PATTERN}),
]
When = Annotated[str, PlainValidator(read_condition), WithJsonSchema(CONDITION_SCHEMA)]


class FaultFields(Section):
    """Times are nanoseconds here and durations such as ``500ms`` outside.

    The types of ``kind``, ``on`` and ``params`` are those of each place.
    """

    kind: Any
    on: Any
    params: Any
    probability: float | None = Field(default=None, gt=0, le=1, description="Of each occurrence; left out, 1.")
    seed: int | None = Field(default=None, ge=0, lt=1 << 64, description="Seed of the random choices, to repeat a run.")
    direction: Directions | None = Field(default=None, description="Direction, seen from the drive.")
    when: When | None = Field(
        default=None,
        description="Begin once this holds on the drive, such as `velocity > 1000`; `after` and `after_cycles` then "
        "count from there.",
    )
    after_cycles: int = Field(
        default=0, ge=0, le=MOST_COUNT, description="Healthy cycles of the connection to let pass first."
    )
    after_ns: Duration = Field(default=0, alias="after", description="Begin after this time.")
    count: int | None = Field(default=None, ge=1, le=MOST_COUNT, description="End after this many occurrences.")
    for_ns: Duration | None = Field(default=None, alias="for", description="End after this time.")
    cycles: int | None = Field(
        default=None, ge=1, le=MOST_COUNT, description="End after this many cycles of the connection."
    )
    share: Share | None = Field(
        default=None,
        description="Only this percentage of the drives that `on` matches, at least one, chosen by the seed.",
    )
    most: int | None = Field(
        default=None,
        ge=1,
        le=MOST_COUNT,
        description="At most this many of the drives that `on` matches, chosen by the seed.",
    )
    rate: Rate | None = Field(
        default=None,
        description="Begin repeatedly at random, at this average rate on each drive (exponential), such as 2/min.",
    )
    times: int | None = Field(
        default=None, ge=1, le=MOST_COUNT, description="With rate: how often it begins on each drive, then it is over."
    )
    ttl_ns: Duration | None = Field(
        default=None,
        alias="ttl",
        description="Time to live: it ends after this time unless it is renewed, also when its client is gone.",
    )
    name: str | None = Field(default=None, alias="as", pattern=PATTERN, description="Name to clear it by.")

    def as_dict(self) -> dict[str, Any]:
        """What was given, as plain values."""
        return self.model_dump(mode="json", by_alias=True, exclude_defaults=True)
