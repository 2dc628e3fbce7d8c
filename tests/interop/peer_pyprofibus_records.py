"""Records by pyprofibus's FDL layer: within the cyclic connection (MSAC1), and by a connection of class 2 (MSAC2).

peer_pyprofibus_records.py PATH GSD MODULE OCTETS ADDRESS

The PDUs are written here octet by octet, after EN 50170 and the profile, with nothing of the project's.
"""

import json
import struct
import sys
import tempfile
import time

from pyprofibus.conf import PbConf
from pyprofibus.fdl import FdlFCB, FdlTelegram, FdlTelegram_ack, FdlTelegram_FdlStat_Req, FdlTelegram_var
from pyprofibus.util import ProfibusError

MASTER, TOOL = 2, 9
SRD = FdlTelegram.FC_REQ | FdlTelegram.FC_SRD_LO
MSAC1, MASTER_2, RESOURCE_MANAGER = 51, 50, 49


class Station:
    """One slave, asked telegram by telegram."""

    def __init__(self, transceiver, address, source, fcb):
        self.transceiver, self.address, self.source, self.fcb = transceiver, address, source, fcb

    def ask(self, dsap, ssap, data=b""):
        """The answer's octets, "ack" for a short one, or the code of one without data."""
        telegram = FdlTelegram_var(
            da=self.address, sa=self.source, fc=SRD, dae=bytearray((dsap,)), sae=bytearray((ssap,)), du=bytearray(data)
        )
        self.transceiver.send(self.fcb, telegram)
        answer = self.answer()
        self.fcb.handleReply()
        if FdlTelegram_ack.checkType(answer):
            return "ack"
        if not answer.du:
            return answer.fc
        assert (answer.dae[0], answer.sae[0]) == (ssap, dsap), answer
        return bytes(answer.du)

    def answer(self):
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            try:
                ok, answer = self.transceiver.poll(0.002)
            except ProfibusError as exc:
                sys.stderr.write(f"{exc}\n")
                continue
            if ok and answer is not None:
                return answer
        raise TimeoutError("no answer")

    def carried_out(self, dsap, ssap, data):
        """Ask, then poll for the answer."""
        assert self.ask(dsap, ssap, data) == "ack"
        for polls in range(1, 500):
            answer = self.ask(dsap, ssap)
            if answer != "ack":
                return answer, polls
        raise TimeoutError("polled in vain")

    def parameter(self, dsap, ssap, request):
        """One request of base mode parameter access: its answer, and how often it was refused before."""
        header = bytes((0, 47, len(request)))
        written, _ = self.carried_out(dsap, ssap, b"\x5f" + header + request)
        assert written == b"\x5f" + header, written
        refused = 0
        while True:
            read, _ = self.carried_out(dsap, ssap, bytes((0x5E, 0, 47, 240)))
            if read[0] == 0x5E:
                assert read[1:4] == bytes((0, 47, len(read) - 4))
                return read[4:], refused
            assert read[:3] == bytes((0xDE, 0x80, 0xB5)), read
            refused += 1


def read_request(reference, pnu):
    return struct.pack(">BBBB BBHH", reference, 1, 0, 1, 0x10, 0, pnu, 0)


def change_request(reference, pnu, value):
    return struct.pack(">BBBB BBHH BBI", reference, 2, 0, 1, 0x10, 0, pnu, 0, 0x43, 1, value)


def values(station, dsap, ssap):
    """P-1283: read, changed, read; and a change of ZSW1, which is refused."""
    before, refused = station.parameter(dsap, ssap, read_request(1, 1283))
    changed, _ = station.parameter(dsap, ssap, change_request(2, 1283, 4000 + dsap))
    after, _ = station.parameter(dsap, ssap, read_request(3, 1283))
    never, _ = station.parameter(dsap, ssap, change_request(4, 968, 1))
    return {
        "before": before.hex(" "), "changed": changed.hex(" "), "after": after.hex(" "), "never": never.hex(" "),
        "refused_before_ready": refused,
    }  # fmt: skip


def main(path, gsd, module, octets, address):
    address = int(address)
    text = [
        "[PROFIBUS]", "debug=0", "[PHY]", "type=serial", f"dev={path}", "baud=1500000", "[DP]", "master_class=1",
        f"master_addr={MASTER}", "[SLAVE_0]", f"addr={address}", f"gsd={gsd}", "sync_mode=1", "freeze_mode=1",
        "group_mask=1", "watchdog_ms=3000", f"module_0={module}", f"output_size={octets}", f"input_size={octets}",
    ]  # fmt: skip
    with tempfile.NamedTemporaryFile("w", suffix=".conf") as file:
        file.write("\n".join(text) + "\n")
        file.flush()
        conf = PbConf.fromFile(file.name)
    master = conf.makeDPM()
    slave = conf.slaveConfs[0].makeDpSlaveDesc()
    master.addSlave(slave)
    master.initialize()
    state = master._DpMaster__slaveStates[address]

    def cycle(seconds):
        """Data are exchanged for a while, then nothing is on its way."""
        end = time.monotonic() + seconds
        while time.monotonic() < end or state.pendingReq is not None or not slave.isConnected():
            assert time.monotonic() < end + 10, "no data exchange"
            master.run()
            slave.setMasterOutData(bytearray((0x04, 0x76)).ljust(int(octets), b"\0"))

    cycle(0.3)
    told = {"msac1": values(Station(master.fdlTrans, address, MASTER, state.fcb), MSAC1, MSAC1)}
    cycle(0.1)
    master.fdlTrans.setRXFilter((MASTER, TOOL))
    tool = Station(master.fdlTrans, address, TOOL, FdlFCB(True))
    initiate = struct.pack(">BxxxH BB BB H BBBB 4x", 0x57, 100, 1, 0, 0, 0, 0, 0, 2, 0, 2)
    manager = tool.ask(RESOURCE_MANAGER, MASTER_2, initiate)
    sap = manager[1]
    opened = tool.ask(sap, MASTER_2)
    told["manager"], told["initiated"] = manager.hex(" "), opened.hex(" ")
    told["msac2"] = values(tool, sap, MASTER_2)
    told["aborted"] = tool.ask(sap, MASTER_2, bytes((0x58, 0, 0)))
    told["closed"] = tool.ask(sap, MASTER_2)
    cycle(0.1)
    master.fdlTrans.send(FdlFCB(False), FdlTelegram_FdlStat_Req(da=address, sa=TOOL))
    told["fdl_status"] = tool.answer().fc
    told["connected"] = slave.isConnected()
    sys.stdout.write(json.dumps(told) + "\n")


main(*sys.argv[1:])
