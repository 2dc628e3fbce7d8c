"""The built-in scanner and drives in real time, over sockets of the kernel's in a network namespace."""

import json

import pytest
from alone import run_alone

FILE = """
farm: cip
link: {link}
api: off
drives:
  - {{name: 'axis-{{n}}', count: 3, model: akd-ethernetip, ip: 10.77.0.11/23}}
controller:
  name: plc
  ip: 10.77.1.250/23
  timeout_multiplier: 512
  program: {{kind: constant, speed_rpm: 60, acknowledge_after: 200ms}}
  {more}
"""
SCRIPT = """
import asyncio, json, subprocess, sys, time
from pnfarm.controller.runtime import Plc
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.farm import Farm
from pnfarm.farm.file.reading import load_farm

def ip(text):
    subprocess.run(["ip", *text.split()], check=True)

async def main(path, given):
    ip("link set lo up")
    ip("link add nic0 type veth peer name plc0")
    ip("link set nic0 up")
    ip("link set plc0 up")
    if given == "bridge":
        ip("link add br0 type bridge mcast_snooping 0")
        ip("link set nic0 master br0")
        ip("link set br0 addrgenmode none up")
        open("/proc/sys/net/ipv4/conf/br0/arp_ignore", "w").write("1")
    config = load_farm(path)
    async with Farm(config) as farm:
        if given == "bridge":
            try:
                async with Plc(config):
                    found = "no error"
            except EnvironmentError_ as exc:
                found = str(exc)
            print(json.dumps(found))
            ip("addr add 10.77.1.250/23 dev plc0")
        async with Plc(config) as plc:
            running = await plc.wait_running(60.0)
            # DRV.OPMODE of the Parameter object
            asked = plc.core.get_attribute("axis-2", 0x0F, 136, 1, time.monotonic_ns())
            while not asked.done:
                await asyncio.sleep(0.01)
            value = int.from_bytes(asked.data, "little")
            rows = plc.summary()
            groups = subprocess.run(["ip", "maddr"], capture_output=True, text=True).stdout.count("inet  239.")
            print(json.dumps([running, value, groups, [[r["losses"], r["group"], r["zsw1"] >> 7 & 1] for r in rows]]))
        left = [[s.fault_counts, dict(s.device.losses()), s.device.connected] for s in farm.core.axes]
        groups = subprocess.run(["ip", "maddr"], capture_output=True, text=True).stdout.count("inet  239.")
        print(json.dumps([left, groups]))

asyncio.run(main(sys.argv[1], sys.argv[2]))
"""


@pytest.mark.parametrize(
    ("link", "more", "groups"),
    [
        ("{kind: veth}", "multicast: false", []),
        ("{kind: macvlan, parent: nic0}", "multicast: true", ["239.192.2.64", "239.192.2.96", "239.192.2.128"]),
        ("{kind: veth, bridge: br0}", "interface: plc0", []),
    ],
)
def test_drives_run_and_are_released_in_real_time(tmp_path, link, more, groups):
    file = tmp_path / "farm.pnfarm.yml"
    file.write_text(FILE.format(link=link, more=more), encoding="utf-8")
    given = "bridge" if "interface" in more else "none"
    lines = [
        json.loads(line) for line in run_alone(SCRIPT, file, given) if line[:1] in {"[", '"'} and line[-1:] in '"]'
    ]
    if given == "bridge":
        assert "10.77.1.250 is no address of this machine" in lines.pop(0)
    (running, mode, joined, rows), (left, after) = lines
    assert running
    assert mode == 1, "the program set the mode"
    assert rows == [[0, group, 1] for group in groups or [None] * 3]
    assert (joined, after) == (len(groups), 0)
    assert left == [[{}, {}, False]] * 3
