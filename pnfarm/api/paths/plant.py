"""The path of the plant."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, Protocol

from pydantic import Field

from pnfarm.web.bodies import Json, Schema

if TYPE_CHECKING:
    from pnfarm.web.paths import Paths

__all__ = ["PlantHost", "PlantModelView", "PlantView", "WireView", "add_plant"]


class PortView(Schema):
    name: str
    direction: Literal["input", "output"] = Field(description="The model's.")
    type: Literal["bit", "number"]
    unit: str
    value: bool | float | str
    owner: Literal["plant", "force", "value", "default"] = Field(
        description="Whose value it is: an output, and an input with a wire that is not forced, are the plant's."
    )


class PlantModelView(Schema):
    name: str
    kind: str = Field(description="Of `pnfarm plant --kinds`, or python.")
    step_seconds: float
    missed_steps: int = Field(description="Of a model in Python: steps left out, because it or the machine was late.")
    longest_seconds: float | None = Field(description="Of a model in Python in real time: its longest step.")
    failure: str = Field(description="Why it makes no more steps; empty: it does.")
    ports: list[PortView]


class WireView(Schema):
    text: str = Field(description="As in the farm file.")
    source: str
    target: str


class PlantView(Schema):
    step_seconds: float | None = Field(description="Null without a plant.")
    steps: int = Field(description="Steps so far.")
    steps_left_out: int = Field(description="Steps that were due while the machine stalled.")
    models: list[PlantModelView]
    wires: list[WireView]


class PlantHost(Protocol):
    async def plant(self) -> dict[str, Any]: ...


def add_plant(path: Paths, host: PlantHost) -> None:
    """Declare it."""

    @path("GET plant", PlantView)
    async def get_plant() -> Json:
        """The plant: its models with the values of their ports, and its wires.

        A model's inputs without a wire are written as a device's: `PATCH devices/{model}/signals`.
        """
        return Json(await host.plant())
