"""pyprofibus as a master of class 1: runs the slaves of a line for a while and prints what it saw, as JSON.

peer_pyprofibus.py PATH GSD MODULE OCTETS SECONDS ADDRESS ...

It ends when each axis has been in operation for POLLS answers, at the latest after so many seconds.
"""

import json
import sys
import tempfile
import time

from pyprofibus.conf import PbConf
from pyprofibus.util import ProfibusError

MASTER = 2
POLLS = 200


def next_word(zsw1, answers):
    """STW1: bits 1, 2 and 10; then 0; then the edge of 3 that P-0144 = 0 asks for."""
    if not zsw1 & 1:
        return 0x0476
    if not zsw1 & 2 or (not zsw1 & 4 and answers % 16 < 8):
        return 0x0477
    return 0x047F


def main(path, gsd, module, octets, seconds, *addresses):
    text = ["[PROFIBUS]", "debug=0", "[PHY]", "type=serial", f"dev={path}", "baud=1500000"]
    text += ["[DP]", "master_class=1", f"master_addr={MASTER}"]
    for number, address in enumerate(addresses):
        text += [
            f"[SLAVE_{number}]", f"addr={address}", f"gsd={gsd}", "sync_mode=1", "freeze_mode=1", "group_mask=1",
            "watchdog_ms=1000", f"module_0={module}", f"output_size={octets}", f"input_size={octets}",
        ]  # fmt: skip
    with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
        file.write("\n".join(text) + "\n")
        file.flush()
        conf = PbConf.fromFile(file.name)
    master = conf.makeDPM()
    slaves = [one.makeDpSlaveDesc() for one in conf.slaveConfs]
    seen = {slave.slaveAddr: {"answers": 0, "inputs": "", "operating": 0, "stw1": 0x0476} for slave in slaves}
    for slave in slaves:
        master.addSlave(slave)
    master.initialize()
    end = time.monotonic() + float(seconds)
    while time.monotonic() < end and any(one["operating"] < POLLS for one in seen.values()):
        try:
            slave = master.run()
        except ProfibusError as exc:
            sys.stderr.write(f"{exc}\n")
            continue
        if slave is None:
            continue
        told = seen[slave.slaveAddr]
        data = slave.getMasterInData()
        if data is not None:
            told["answers"] += 1
            told["inputs"] = bytes(data).hex()
            word = data[0] << 8 | data[1]
            # behind a lost connection the drive needs its edges again: pyprofibus parametrises slaves twice at times
            told["operating"] += word & 0x0F == 7
            told["stw1"] = next_word(word, told["answers"])
        stw1 = told["stw1"]
        slave.setMasterOutData(bytearray((stw1 >> 8, stw1 & 0xFF, 0x08, 0x00)).ljust(int(octets), b"\0"))
    for slave in slaves:
        seen[slave.slaveAddr]["connected"] = slave.isConnected()
    sys.stdout.write(json.dumps(seen) + "\n")


main(*sys.argv[1:])
