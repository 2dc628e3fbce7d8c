"""Shards: every part has its drives as the whole farm gives them, and together the parts are the farm."""

from __future__ import annotations

import os
import socket
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

import pnfarm
from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.farm import farm as farm_module
from pnfarm.farm.farm import Farm, make_way
from pnfarm.farm.file.reading import expand, parse_farm
from pnfarm.farm.load import costs_of
from pnfarm.farm.shard import Shard, parse_shard, part_of
from pnfarm.links.kernel.ownership import FarmLock, group_of, interface_prefix, is_own, owner_of, tag

MODELS = {
    "akd-profinet": "limits: lax, cycle: {0}ms",
    "hiwin-e1": "limits: lax, cycle: {0}ms",
    "akd-ethernetip": "limits: lax, rpi: {0}ms",
}


def farm(*groups: str, link: str = "{kind: macvlan, parent: eth1}", more: str = ""):
    drives = "\n".join(f"  - {{{group}}}" for group in groups)
    return parse_farm(f"farm: line-1\nlink: {link}\n{more}\ndrives:\n{drives}\n", "line-1.pnfarm.yml")


def plain(count: int, **given: str):
    return farm(f"name: 'axis-{{n:04}}', count: {count}, model: akd-profinet, ip: 10.77.0.11/16", **given)


def parts(config, count):
    whole = expand(config)
    return [part_of(config, whole, Shard(index, count)) for index in range(1, count + 1)]


MIXES = st.lists(
    st.tuples(st.integers(1, 12), st.sampled_from(sorted(MODELS)), st.sampled_from([1, 2, 4, 8, 16, 64])),
    min_size=1,
    max_size=5,
)


def mixed(mix):
    groups = []
    for number, (count, model, cycle) in enumerate(mix):
        keys = MODELS[model].format(cycle)
        groups.append(f"name: 'a{number}-{{n}}', count: {count}, model: {model}, ip: 10.{number}.0.1/8, {keys}")
    return farm(*groups)


@given(MIXES, st.integers(1, 8))
def test_the_parts_are_the_farm_and_cost_the_same_up_to_one_drive(mix, count):
    config = mixed(mix)
    whole = expand(config)
    if count > len(whole):
        return
    dealt = parts(config, count)
    # equal entries: names, addresses, MACs, seeds and places are those of the whole farm
    assert sorted((drive for part in dealt for drive in part), key=lambda drive: drive.index) == whole
    assert all(part and part == sorted(part, key=lambda drive: drive.index) for part in dealt)
    costs = dict(zip((drive.name for drive in whole), costs_of(config, whole), strict=True))
    sums = [sum(costs[drive.name] for drive in part) for part in dealt]
    assert max(sums) - min(sums) <= max(costs.values())


@given(MIXES, st.integers(1, 8), st.sampled_from(sorted(MODELS)))
def test_a_drive_at_the_end_of_the_file_moves_no_other(mix, count, model):
    before = mixed(mix)
    if count > len(expand(before)):
        return
    after = mixed([*mix, (1, model, 2)])
    for old, new in zip(parts(before, count), parts(after, count), strict=True):
        assert [drive.name for drive in old] == [drive.name for drive in new][: len(old)]


def test_a_short_cycle_weighs_more_than_a_long_one():
    config = farm(
        "name: fast, model: akd-profinet, ip: 10.0.0.1/24, limits: lax, cycle: 1ms",
        "name: 'slow-{n}', count: 8, model: akd-profinet, ip: 10.0.0.11/24, limits: lax, cycle: 16ms",
    )
    first, second = parts(config, 2)
    assert first[0].name == "fast"
    assert len(second) > len(first)


LINES = "{kind: macvlan, parent: eth1, lines: {profibus: {pty: auto}}}"


def test_the_drives_on_a_line_stay_together_and_only_their_shard_opens_it():
    config = farm(
        "name: 'net-{n}', count: 6, model: akd-profinet, ip: 10.0.0.1/24",
        "name: 'dp-{n}', count: 4, model: moog-msd-dp, address: 3",
        link=LINES,
    )
    dealt = parts(config, 3)
    on_line = [[drive.name for drive in part if drive.name.startswith("dp")] for part in dealt]
    assert sorted(map(len, on_line)) == [0, 0, 4]
    for index, names in enumerate(on_line, start=1):
        lines = getattr(Farm(config, shard=Shard(index, 3)).link, "lines", {})
        assert list(lines) == (["profibus"] if names else [])
    with pytest.raises(ConfigError, match="8 shards are too many for farm line-1: at most 7, as its drives on a line"):
        part_of(config, expand(config), Shard(1, 8))


@pytest.mark.parametrize("text", ["", "1", "1/", "/3", "a/b", "1/2/3", "-1/3", "1.0/3", "1/3x", "99999999/1", "١/٣"])
def test_what_is_no_shard_is_said_in_one_sentence(text):
    with pytest.raises(ConfigError, match=r"^--shard: .* is not a shard: I/N with I from 1 to N, such as 1/3$"):
        parse_shard(text)


@pytest.mark.parametrize("text", ["0/3", "4/3", "1/0", "0/0", "1/10000"])
def test_a_shard_out_of_range_is_said_in_one_sentence(text):
    with pytest.raises(ConfigError, match=rf"^--shard: there is no shard {text}: I/N with I from 1 to N"):
        parse_shard(text)


def test_more_shards_than_drives_are_refused():
    config = plain(2)
    with pytest.raises(ConfigError, match="3 shards are too many for farm line-1: at most 2, as many as it has drives"):
        part_of(config, expand(config), Shard(1, 3))


def test_shards_need_a_wire_in_common():
    with pytest.raises(ConfigError, match="name a bridge"):
        Farm(plain(4, link="{kind: veth}"), shard=Shard(1, 2))
    assert len(Farm(plain(4, link="{kind: veth}"), shard=Shard(1, 1)).drives) == 4
    serial = farm("name: 'dp-{n}', count: 4, model: moog-msd-dp, address: 3", link="{kind: serial, pty: auto}")
    with pytest.raises(ConfigError, match="one serial line cannot be divided"):
        Farm(serial, shard=Shard(1, 2))


IN_MEMORY = """\
farm: line-1
link: {kind: memory}
drives:
  - name: axis-{n:02}
    count: 5
    model: akd-profinet
    ip: 10.77.0.11/24
    impair: [{kind: loss, on: axis-05, probability: 0.001, seed: 7}]
controller: {ip: 10.77.0.1/24, cycle: 16ms}
"""


async def run_in_memory(shard):
    async with pnfarm.Farm.from_text(IN_MEMORY, virtual=True, shard=shard) as part:
        await part.wait_connected()
        faults = [injection.spec.on for injection in part.core.injections.list()]
        return [drive.name for drive in part.drives], faults


@pytest.mark.asyncio
async def test_in_memory_a_shard_runs_with_a_controller_for_its_drives():
    assert await run_in_memory("1/2") == (["axis-01", "axis-03", "axis-05"], [["axis-05"]])
    # the fault of a drive elsewhere is no error here
    assert await run_in_memory("2/2") == (["axis-02", "axis-04"], [])


class Left:
    """Interfaces that killed runs of these owners left: one each, made and tagged, or not tagged yet."""

    def __init__(self, *owners, untagged=()):
        self.there = [self._of(owner, tag(owner, "axis")) for owner in owners]
        self.there += [self._of(owner, "") for owner in untagged]

    @staticmethod
    def _of(owner, alias):
        return SimpleNamespace(owner=owner, name=f"{interface_prefix(owner)}-0", alias=alias, group=group_of(owner))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def everything(self):
        return self.there

    def remove(self, owner):
        self.there = [one for one in self.there if not is_own(owner, one.name, one.alias, one.group)]


@pytest.mark.parametrize(
    ("starts", "stays"),
    [("", []), ("1/2", ["line-1 2/2"]), ("1/3", [])],
    ids=["whole", "same division", "other division"],
)
def test_a_start_removes_what_killed_runs_with_its_drives_left(monkeypatch, starts, stays):
    shards = [owner_of("line-1", shard) for shard in ("1/2", "2/2")]
    left = Left("line-1", *shards, "line-2", "line-1 plc", untagged=[owner_of("line-1", starts)])
    monkeypatch.setattr(farm_module, "Interfaces", lambda: left)
    make_way(plain(4), parse_shard(starts) if starts else None)
    assert [one.owner for one in left.there] == [*stays, "line-2", "line-1 plc"]


def test_a_shard_in_another_network_is_not_told_as_an_earlier_process(tmp_path, monkeypatch):
    monkeypatch.setattr(FarmLock, "_bind", lambda _: socket.socket(socket.AF_UNIX))
    with FarmLock("line-1", tmp_path), pytest.raises(EnvironmentError_, match=f"pid {os.getpid()}"):
        FarmLock("line-1", tmp_path, shard="1/2").acquire()
    with (
        FarmLock("line-1", tmp_path, shard="1/2"),
        pytest.raises(EnvironmentError_, match="farm line-1 is already running: stop it first"),
    ):
        FarmLock("line-1", tmp_path).acquire()
