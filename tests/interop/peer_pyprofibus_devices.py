"""pyprofibus as a master of class 1: runs slaves by their GSD files for a while and prints what it saw, as JSON.

peer_pyprofibus_devices.py PATH SECONDS SLAVES

SLAVES is a JSON list of objects: ``address``, ``gsd``, ``modules`` (names), ``octets`` to the slave and from it,
``data`` to the slave in hexadecimal, ``diagnoses``: how many with extended diagnosis to wait for.  It ends when each
slave has answered ANSWERS times and had its diagnoses, at the latest after so many seconds.
"""

import json
import sys
import tempfile
import time
from collections import defaultdict

from pyprofibus.conf import PbConf
from pyprofibus.dp import DpTelegram_SlaveDiag_Con
from pyprofibus.util import ProfibusError

ANSWERS = 100


def configured(path, slaves):
    text = ["[PROFIBUS]", "debug=0", "[PHY]", "type=serial", f"dev={path}", "baud=1500000"]
    text += ["[DP]", "master_class=1", "master_addr=2"]
    for number, one in enumerate(slaves):
        outputs, inputs = one["octets"]
        text += [f"[SLAVE_{number}]", f"addr={one['address']}", f"gsd={one['gsd']}", "watchdog_ms=1000"]
        # its words are the slave's
        text += [f"input_size={outputs}", f"output_size={inputs}"]
        text += [f"module_{place}={name}" for place, name in enumerate(one["modules"])]
    with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
        file.write("\n".join(text) + "\n")
        file.flush()
        return PbConf.fromFile(file.name)


def main(path, seconds, slaves):
    slaves = json.loads(slaves)
    # of a diagnosis it keeps the first six octets alone
    read, diagnoses = DpTelegram_SlaveDiag_Con.fromFdlTelegram, defaultdict(list)

    def seen(fdl):
        diagnoses[fdl.sa].append(bytes(fdl.du).hex(" "))
        return read(fdl)

    DpTelegram_SlaveDiag_Con.fromFdlTelegram = seen
    conf = configured(path, slaves)
    master = conf.makeDPM()
    descriptions = [one.makeDpSlaveDesc() for one in conf.slaveConfs]
    for slave in descriptions:
        master.addSlave(slave)
    master.initialize()
    answers, inputs = defaultdict(int), {}
    wanted = {one["address"]: (bytes.fromhex(one["data"]), one.get("diagnoses", 0)) for one in slaves}

    def done(address):
        extended = [one for one in diagnoses[address] if len(one) > 17]
        return answers[address] >= ANSWERS and len(extended) >= wanted[address][1]

    end = time.monotonic() + float(seconds)
    while time.monotonic() < end and not all(map(done, wanted)):
        try:
            slave = master.run()
        except ProfibusError as exc:
            sys.stderr.write(f"{exc}\n")
            continue
        if slave is None:
            continue
        data = slave.getMasterInData()
        if data is not None:
            answers[slave.slaveAddr] += 1
            inputs[slave.slaveAddr] = bytes(data).hex(" ")
        slave.setMasterOutData(bytearray(wanted[slave.slaveAddr][0]))
    told = {
        slave.slaveAddr: {
            "connected": bool(slave.isConnected()),
            "answers": answers[slave.slaveAddr],
            "inputs": inputs.get(slave.slaveAddr, ""),
            "diagnoses": diagnoses[slave.slaveAddr],
        }
        for slave in descriptions
    }
    sys.stdout.write(json.dumps(told) + "\n")


main(*sys.argv[1:])
