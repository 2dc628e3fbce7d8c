"""Non-volatile memory of another shape: refused with file and drive, and left as it is."""

from __future__ import annotations

import asyncio
import json
import sqlite3
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from pnfarm.buses.profinet.device.memory.kept_values import check_kept
from pnfarm.controller.line import VirtualLine
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.file.reading import parse_farm
from pnfarm.farm.memory.rows import _from_json, _to_json
from pnfarm.farm.memory.sqlite import FILE_NAME, FarmState
from pnfarm.station.event_log import EventLog

FILE = """
farm: kept
link: {kind: memory}
drives:
  - {name: axis-01, model: MODEL}
"""
KEYS = ("name", "ip", "gateway", "dns", "hello", "im", "pdev", "snmp", "faults", "drive")


def booted(state: FarmState, model: str = "akd-profinet") -> VirtualLine:
    config = parse_farm(FILE.replace("MODEL", model))
    line = asyncio.run(VirtualLine.create(config, memory=state, log=EventLog(quiet=True)))
    line.world.run(0.05)
    return line


def refused(act: Callable[[], object]) -> str | None:
    """The sentence of a refusal, None when there is none."""
    try:
        act()
    except EnvironmentError_ as exc:
        return str(exc)
    return None


def rows(folder: Path) -> list[tuple[str, str, str]]:
    with sqlite3.connect(folder / FILE_NAME) as connection:
        return connection.execute("SELECT station, key, value FROM memory ORDER BY station, key").fetchall()


WRONG: list[tuple[str, Any]] = [
    ("name", 5),
    ("name", "Not A Name"),
    ("name", "x" * 300),
    ("ip", ["10.77.0.11"]),
    ("ip", "10.77.0.11/99"),
    ("ip", "127.0.0.1/8"),
    ("gateway", {"a": 1}),
    ("dns", ["10.0.0.1"]),
    ("dns", 4),
    ("hello", [1, 2]),
    ("hello", ["a", 1, 1, 1]),
    ("im", {"0.1": b"x"}),
    ("im", {"0.1.2": "text"}),
    ("pdev", []),
    ("pdev", {"0.1.99999": b""}),
    ("snmp", {"COLOUR": "red"}),
    ("snmp", {"CONTACT": 1}),
    ("faults", {"702": 1}),
    ("faults", [1 << 40]),
    ("faults", [[702]]),
    ("faults", [0] * 1000),
    ("drive", []),
    ("drive", {"parameters": [1, 2]}),
    ("drive", {"parameters": {"2108": "fast"}}),
    ("drive", {"parameters": {"2108": {"a": 1}}}),
    ("drive", {"parameters": {"2108": 1.5}}),
    ("drive", {"parameters": {"2108": 1 << 70}}),
    ("drive", {"parameters": {}, "motion_tasks": [1]}),
    ("drive", {"parameters": {}, "motion_tasks": {"one": {}}}),
    ("drive", {"model": 7, "parameters": {}}),
]


@pytest.mark.parametrize(("key", "value"), WRONG)
def test_a_value_of_another_shape_is_refused_with_file_and_drive_and_nothing_is_lost(
    tmp_path: Path, key: str, value: Any
) -> None:
    with FarmState(tmp_path) as state:
        state.save("axis-01", {"name": "press", "im": {"0.1.45041": b"kept"}, key: value})
        state.save("axis-02", {"name": "other"})
        before = rows(tmp_path)
        with pytest.raises(EnvironmentError_) as caught:
            booted(state)
    message = str(caught.value)
    assert str(tmp_path / FILE_NAME) in message
    assert "axis-01" in message
    assert repr(key) in message
    assert "\n" not in message
    assert rows(tmp_path) == before


def test_what_a_drive_writes_has_the_shape_that_it_boots_with(tmp_path: Path) -> None:
    with FarmState(tmp_path) as state:
        for model in ("akd-profinet", "hiwin-e1", "moog-msd"):
            state.delete("axis-01")
            line = booted(state, model)
            (station,) = line.farm.axes
            station.station.keep(line.world.now, "drive", station.store.snapshot())
            station.raise_fault("overvoltage", hold=False)
            line.world.run(0.1)
            kept = state.load("axis-01") or {}
            assert kept["faults"]
            check_kept(kept)
            station.station.power_cycle(line.world.now)
            line.farm.settle(station.station, line.world.now)


def test_a_farm_killed_between_any_two_writes_comes_back_with_what_was_saved_and_no_more(tmp_path: Path) -> None:
    rng = Random(64)
    line = booted(FarmState(tmp_path))
    saved = {name: line.farm.axes[0].store.get(name) for name in ("DRV.ACC", "DRV.DEC")}
    for _ in range(40):
        (station,) = line.farm.axes
        store = station.store
        written = {}
        for _ in range(rng.randrange(1, 6)):
            name = rng.choice(list(saved))
            # as the drive rounds it, in its units of acceleration
            store.set(name, rng.randrange(1_000_000, 9_000_000))
            written[name] = store.get(name)
            if rng.random() < 0.4:
                store.set("DRV.NVSAVE", 1)
                line.farm.settle(station.station, line.world.now)
                saved |= written
        # nothing is closed: as SIGKILL leaves it, the next one has the file alone
        line = booted(FarmState(tmp_path))
        assert {name: line.farm.axes[0].store.get(name) for name in saved} == saved


def test_keys_of_a_newer_program_are_kept(tmp_path: Path) -> None:
    with FarmState(tmp_path) as state:
        state.save("axis-01", {"name": "press", "tomorrow": [1, {"a": None}]})
        line = booted(state)
        line.farm.axes[0].station.keep(line.world.now, "faults", [702])
        assert (state.load("axis-01") or {})["tomorrow"] == [1, {"a": None}]


def test_what_another_model_kept_is_reported_and_left_out(tmp_path: Path) -> None:
    with FarmState(tmp_path) as state:
        state.save("axis-01", {"drive": {"model": "x", "parameters": {"64000": 1, "nothing": 2}}})
        line = booted(state)
    (told,) = [entry for entry in line.farm.log.entries("axis-01") if entry.event == "memory not taken"]
    assert told.data["count"] == 2
    assert told.data["first"].startswith("kept parameter 64000")


def _json() -> st.SearchStrategy[Any]:
    leaves = st.one_of(
        st.none(), st.booleans(), st.integers(-(2**70), 2**70), st.floats(allow_nan=False), st.text(max_size=8),
        st.binary(max_size=8), st.sampled_from(["10.77.0.11/24", "axis-01", "0.1.45041", "1000", "CONTACT", "64000"]),
    )  # fmt: skip
    keys = st.one_of(st.text(max_size=6), st.sampled_from(["parameters", "motion_tasks", "model", "1", "0.0.32817"]))
    return st.recursive(
        leaves, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4), max_leaves=12
    )


@settings(
    max_examples=60,
    deadline=None,
    derandomize=True,
    phases=(Phase.explicit, Phase.generate),
    suppress_health_check=[HealthCheck.too_slow],
)
@given(st.dictionaries(st.sampled_from(KEYS), _json(), min_size=1, max_size=3))
def test_any_memory_boots_a_drive_or_is_refused_with_a_reason(values: dict[str, Any]) -> None:
    state = FarmState(None)
    try:
        state.save("axis-01", values)
    except TypeError:
        return
    kept = state.load("axis-01")
    refusal = refused(lambda: booted(state))
    if refusal is not None:
        assert "axis-01" in refusal
        assert state.load("axis-01") == kept


@given(_json())
def test_a_check_of_any_value_ends_in_yes_or_no(value: Any) -> None:
    for key in KEYS:
        refusal = refused(lambda key=key: check_kept({key: value}))
        assert refusal is None or repr(key) in refusal


@pytest.mark.parametrize(
    "text", ['{"$octets": "zz"}', '{"$pairs": [1]}', '{"$pairs": [[1]]}', '{"$pairs": [[[1], 2]]}']
)
def test_octets_and_pairs_of_another_shape_are_damage(tmp_path: Path, text: str) -> None:
    with FarmState(tmp_path) as state:
        state.save("axis-01", {"name": "press"})
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.execute("UPDATE memory SET value = ? WHERE key = 'name'", (text,))
    with FarmState(tmp_path) as state, pytest.raises(EnvironmentError_, match="is damaged"):
        state.load("axis-01")
    assert _from_json(json.loads(json.dumps(_to_json({1: b"a"})))) == {1: b"a"}
