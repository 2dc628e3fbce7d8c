"""The couplings of shafts that a farm file can have."""

from __future__ import annotations

from dataclasses import dataclass

from pnfarm.behaviours.declaration import Parameter, Port, number, quantity
from pnfarm.table.plant import COUPLING_ELASTIC, COUPLING_RIGID

__all__ = ["COUPLINGS", "CouplingKind"]


@dataclass(frozen=True, slots=True)
class CouplingKind:
    """``shafts``: how many axes it joins; ``ports``: with their places among a coupling's values."""

    name: str
    doc: str
    equation: str
    code: int
    shafts: int
    inputs: tuple[tuple[Port, int], ...]
    outputs: tuple[tuple[Port, int], ...]
    parameters: tuple[Parameter, ...]

    @property
    def port_lists(self) -> tuple[tuple[Port, ...], tuple[Port, ...]]:
        """Inputs, outputs."""
        return tuple(port for port, _ in self.inputs), tuple(port for port, _ in self.outputs)

    @property
    def kind_name(self) -> str:
        return self.name

    @property
    def ports(self) -> tuple[tuple[Port, int], ...]:
        return self.inputs + self.outputs


_OFFSET = (number("offset", "angle between the shafts at which the spring is free", "revolutions"), 0)
_TORQUE = (number("torque", "on the first shaft, against its direction", "Nm"), 2)
_TWIST = (number("twist", "the first shaft ahead of the second", "revolutions"), 3)
_SPRING = (
    quantity("stiffness", "of the spring, Nm/rad", low=1e-6, high=1e9),
    quantity("damping", "parallel to the spring, Nm s/rad", default=0.0, low=0.0, high=1e6),
    quantity("backlash", "from stop to stop", "deg", default=0.0, low=0.0, high=360.0),
)
_RATIO = quantity("ratio", "revolutions of the second for one of the first", default=1.0, low=1e-6, high=1e6)
_START = quantity("offset", "value of the port offset at the start", "revolutions", default=0.0, low=-1e9, high=1e9)

#: By name.
COUPLINGS: dict[str, CouplingKind] = {
    one.name: one
    for one in (
        CouplingKind(
            "elastic-load",
            "A mass behind a spring on an axis' shaft: two masses with resonance, damper and backlash.",
            "T = stiffness * twist + damping * speed of the twist; inertia * dw/dt = T - load_torque - friction * w",
            COUPLING_ELASTIC,
            1,
            (_OFFSET, (number("load_torque", "on the mass, against its direction", "Nm"), 1)),
            (
                _TORQUE,
                _TWIST,
                (number("position", "of the mass", "revolutions"), 4),
                (number("velocity", "of the mass", "rpm"), 5),
            ),
            (
                *_SPRING,
                quantity("inertia", "of the mass, kg m^2", low=1e-12, high=1e6),
                quantity("friction", "viscous, of the mass, Nm s/rad", default=0.0, low=0.0, high=1e6),
                _START,
            ),
        ),
        CouplingKind(
            "elastic-coupling",
            "A spring between two axes: a gantry, a shaft, a web.",
            "T = stiffness * twist + damping * speed of the twist",
            COUPLING_ELASTIC,
            2,
            (_OFFSET,),
            (_TORQUE, _TWIST),
            (*_SPRING, _RATIO, _START),
        ),
        CouplingKind(
            "rigid-coupling",
            "Two axes that turn as one: a gear, a common roll, a stiff gantry.",
            "speed of the first * ratio = speed of the second",
            COUPLING_RIGID,
            2,
            (_OFFSET,),
            (_TORQUE, _TWIST),
            (_RATIO, _START),
        ),
    )
}
