"""Names, tags, locks; and what is left when a run dies in whatever way."""

import os
import signal
import socket
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.errors import ConfigError, EnvironmentError_
from pnfarm.links.kernel.interfaces import remove_leftovers_now
from pnfarm.links.kernel.ownership import (
    FarmLock,
    doomed_group_of,
    group_of,
    interface_prefix,
    is_own,
    owner_of,
    shards_in,
    tag,
)

ROOT = Path(__file__).resolve().parents[2]


def start(program, *arguments):
    """Run a program in this test's namespace until it says that it is ready."""
    process = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program), *arguments],
        cwd=ROOT,
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
    )
    assert process.stdout.readline() == "ready\n"
    return process


def end(process, number):
    process.send_signal(number)
    code = process.wait(20)
    process.stdout.close()
    return code


@given(st.text(min_size=1, max_size=60), st.text(max_size=250))
def test_a_tag_fits_and_is_recognised(farm, station):
    try:
        alias = tag(farm, station)
    except ConfigError:
        assert len(farm) > 16  # letters that quoting makes long
        return
    except UnicodeEncodeError:
        return
    assert len(alias.encode()) <= 255
    assert len(interface_prefix(farm)) == 6
    assert is_own(farm, f"{interface_prefix(farm)}-12", alias, 0)
    assert not is_own(farm, "eth0", alias, group_of(farm))
    assert not is_own(farm, f"{interface_prefix(farm)}-12", "", 0)
    assert not is_own(farm + "x", f"{interface_prefix(farm + 'x')}-12", alias, 0)
    assert is_own(farm, f"{interface_prefix(farm)}-12", "", group_of(farm))


def test_a_farm_whose_name_has_a_colon_is_another_farm():
    assert not is_own("a", f"{interface_prefix('a')}-0", tag("a:b", "axis"), 0)


def test_groups_do_not_meet():
    farms = [f"line-{n}" for n in range(2000)]
    groups = [group_of(farm) for farm in farms] + [doomed_group_of(farm) for farm in farms]
    assert len(set(groups)) == len(groups)
    assert all(2**29 < group < 2**31 for group in groups)


def test_a_name_too_long_for_a_tag_is_refused():
    with pytest.raises(ConfigError, match="too long"):
        tag("x" * 230, "axis")


HOLDER = """
    import sys, time
    from pathlib import Path
    from pnfarm.links.kernel.ownership import FarmLock
    lock = FarmLock("line-1", Path(sys.argv[1]))
    lock.acquire()
    print("ready", flush=True)
    time.sleep(60)
"""


def test_a_farm_runs_once_and_the_refusal_names_the_process(tmp_path):
    holder = start(HOLDER, str(tmp_path))
    try:
        with pytest.raises(EnvironmentError_, match=rf"farm line-1 is already running \(pid {holder.pid}\)"):
            FarmLock("line-1", tmp_path / "elsewhere").acquire()
        with FarmLock("line-2", tmp_path):
            pass
    finally:
        assert end(holder, signal.SIGKILL) == -signal.SIGKILL
    # a killed holder holds nothing
    with FarmLock("line-1", tmp_path) as lock:
        lock.acquire()
        assert (tmp_path / "line-1.lock").read_text() == f"{os.getpid()}\n"
    with FarmLock("line-1", tmp_path):
        pass


SHARDS = """
    import sys, time
    from pathlib import Path
    from pnfarm.links.kernel.ownership import FarmLock
    lock = FarmLock("line-1", Path(sys.argv[1]), shard=sys.argv[2])
    lock.acquire()
    print("ready", flush=True)
    time.sleep(60)
"""


@pytest.mark.parametrize("apart", [False, True])
def test_a_shard_leaves_room_for_those_beside_it_and_for_no_other_division(namespace, tmp_path, apart):
    """By the namespace's sockets, or by the state folder of a namespace apart."""
    program = textwrap.dedent(SHARDS)
    if apart:
        program = f"import ctypes; ctypes.CDLL(None).unshare(0x40000000)\n{program}"
    holder = start(program, str(tmp_path), "1/3")
    try:
        with FarmLock("line-1", tmp_path, shard="2/3"), FarmLock("line-1", tmp_path, shard="3/3"):
            pass
        for shard, running in (("1/3", "shard 1/3 of farm"), ("1/2", "shard 1/3 of farm"), ("", "farm")):
            lock = FarmLock("line-1", tmp_path, shard=shard)
            with pytest.raises(EnvironmentError_, match=rf"{running} line-1 is already running"):
                lock.acquire()
        with FarmLock("line-2", tmp_path), FarmLock("line-11", tmp_path, shard="1/2"):
            pass
    finally:
        end(holder, signal.SIGKILL)
    with FarmLock("line-1", tmp_path):
        pass
    with FarmLock("line-1", tmp_path), pytest.raises(EnvironmentError_, match="has drives of this one"):
        FarmLock("line-1", tmp_path, shard="1/3").acquire()


def test_shards_are_known_by_the_tags_of_their_interfaces():
    aliases = [tag(owner_of("a b", shard), "axis") for shard in ("2/3", "1/3", "1/3", "")]
    aliases += [tag(owner_of("a b c", "1/2"), "axis"), tag(owner_of("a", "1/2"), "axis"), tag("a b plc", "plc"), ""]
    assert shards_in("a b", aliases) == ["1/3", "2/3"]
    owner = owner_of("a b", "1/3")
    assert is_own(owner, f"{interface_prefix(owner)}-0", aliases[1], 0)
    assert not is_own("a b", f"{interface_prefix('a b')}-0", aliases[1], 0)


def test_a_shared_state_folder_is_locked_across_namespaces(namespace, tmp_path):
    program = f"import ctypes; ctypes.CDLL(None).unshare(0x40000000)\n{textwrap.dedent(HOLDER)}"
    holder = start(program, str(tmp_path))
    try:
        with pytest.raises(EnvironmentError_, match=rf"already running \(pid {holder.pid}\)"):
            FarmLock("line-1", tmp_path).acquire()
        with FarmLock("line-1"):  # without a common folder the two have nothing in common
            pass
    finally:
        end(holder, signal.SIGKILL)


def test_a_state_folder_that_cannot_be_written_is_named(tmp_path):
    (tmp_path / "file").touch()
    lock = FarmLock("line-1", tmp_path / "file" / "state")
    with pytest.raises(EnvironmentError_, match=r"state folder .* cannot be written"):
        lock.acquire()
    with FarmLock("line-1"):
        pass


RUN = """
    import asyncio, signal, sys
    from pnfarm.links.base import PortSpec
    from pnfarm.links.macvlan import MacvlanLink
    from pnfarm.links.tap import TapLink
    from pnfarm.links.veth import VethLink

    link = {
        "macvlan": lambda: MacvlanLink("line-1", "nic0"),
        "veth": lambda: VethLink("line-1", own_bridge=True),
        "tap": lambda: TapLink("line-1"),
    }[sys.argv[1]]()

    # under nohup it is handed on that SIGINT is ignored
    signal.signal(signal.SIGINT, signal.default_int_handler)

    async def main():
        task = asyncio.current_task()
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, task.cancel)
        await link.open([PortSpec(f"axis-{n}", bytes([2, 0, 0, 0, 0, n])) for n in range(8)])
        try:
            print("ready", flush=True)
            await asyncio.sleep(600)
        finally:
            await link.close()

    asyncio.run(main())
"""


def own_interfaces():
    return sorted(name for _, name in socket.if_nameindex() if name.startswith("pf"))


@pytest.mark.parametrize("kind", ["macvlan", "veth", "tap"])
def test_a_killed_run_leaves_what_the_next_one_removes(cable, kind):
    if kind == "tap" and not os.access("/dev/net/tun", os.R_OK | os.W_OK):
        pytest.skip("needs /dev/net/tun")
    process = start(RUN, kind)
    running = own_interfaces()
    assert len(running) == {"macvlan": 8, "veth": 17, "tap": 8}[kind]
    assert end(process, signal.SIGKILL) == -signal.SIGKILL
    assert sorted(remove_leftovers_now("line-1")) == ([] if kind == "tap" else running)
    assert own_interfaces() == []
    assert {name for _, name in socket.if_nameindex()} >= {"nic0", "plc0"}


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_run_that_is_asked_to_end_leaves_nothing(cable, number):
    process = start(RUN, "macvlan")
    assert len(own_interfaces()) == 8
    process.send_signal(number)
    process.wait(120)
    process.stdout.close()
    assert own_interfaces() == []
