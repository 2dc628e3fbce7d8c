"""A farm file that is right, and what is said of one that is wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from pnfarm.farm.file.reading import FarmFileError, Known, parse_farm

CONFIGS = Path(__file__).resolve().parents[2] / "configs"


@dataclass(frozen=True)
class Model:
    """A model of no catalogue: one telegram, one parameter, 16 ms."""

    name: str = "akd-profinet"
    min_cycle_ns: int = 16_000_000
    send_clocks: tuple[int, ...] = (8, 16, 32, 64, 128)
    max_cycle_ns: int = 0
    telegrams: tuple[int, ...] = (1, 7)
    supplements: tuple[int, ...] = ()
    motion_tasks: int = 0
    most_axes: int = 1
    described: None = None
    aliases: tuple[str, ...] = ()
    bus: str = "profinet"
    open_points: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def parameter_complaints(self, params):
        return [(key, "is no parameter", "DRV.OPMODE") for key in params if key != "DRV.OPMODE"]

    def words_complaints(self, words):
        return []

    def behaviour_complaints(self, behaviour):
        return [(key, "is not an open point", "none") for key in behaviour]

    def moves_straight(self, kind):
        return kind == "linear"

    def motor_complaints(self, kind, pitch):
        return []

    def axis_complaints(self, load, motor):
        return []

    def realism_complaints(self, realism):
        return []

    def identity_complaints(self, identity):
        return [(key, "is no identity", "vendor") for key in identity if key != "vendor"]


KNOWN = Known(
    ("akd-profinet",),
    {"akd-profinet": Model(), "akd": Model(), "quick": Model("quick", 500_000, max_cycle_ns=4_000_000)}.get,
    frozenset(("loss", "silence", "f702", "drive-fault")),
)

GOOD = """\
farm: line-1
link: {kind: macvlan, parent: eth1}
state: ./state
api: 127.0.0.1:8702
drives:
  - name: axis-{n:02}
    count: 8
    model: akd-profinet
    ip: 10.77.0.11/24
    mac: auto
    load: {inertia: 2.0e-4, friction: 0.05}
    limits: strict
    identity: {}
    params: {DRV.OPMODE: 1}
    impair: []
"""


def parse(text, path="line.pnfarm.yml"):
    return parse_farm(text, path, KNOWN)


def issues(text):
    with pytest.raises(FarmFileError) as caught:
        parse(text)
    return caught.value.issues


def the_issue(text):
    (issue,) = issues(text)
    return issue
