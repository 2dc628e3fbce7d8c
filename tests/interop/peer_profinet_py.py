"""profinet-py against a drive: ``peer_profinet_py.py VERB STATION [OPTION ...]``; what it found as one line of JSON."""

# ruff: noqa: T201 - what it prints is its answer

from __future__ import annotations

import json
import logging
import sys
import time
import warnings

from profinet import IOCRSetup, IOSlot, ProfinetDevice, dcp, scan
from profinet.gsdml import load_gsdml
from profinet.rpc import RPCCon, epm_lookup
from profinet.util import ethernet_socket, get_mac

INTERFACE = "plc0"
PROFIDRIVE = 0x3A00
#: Base mode: request 1, read, axis 0, one parameter; its value, five elements of PNU 964 (identification) from 0.
READ_964 = bytes.fromhex("01 01 00 01  10 05 03c4 0000")
TELEGRAM = (1, 2)


def discover(*_):
    return [
        {
            "name": device.name,
            "ip": device.ip,
            "mac": device.mac,
            "vendor": device._info.vendor_id,
            "device": device._info.device_id,
            "roles": device._info.device_roles,
        }
        for device in scan(INTERFACE, timeout=2)
    ]


def by_name(station):
    return ProfinetDevice.discover(station, INTERFACE, timeout=2)


def rename(mac, name, ip):
    """DCP's Set verbs, then what Get and Identify say."""
    found = {}
    with ethernet_socket(INTERFACE) as sock:
        source = get_mac(INTERFACE)
        found["name_set"] = dcp.set_param(sock, source, mac, "name", name)
        found["ip_set"] = dcp.set_ip(sock, source, mac, ip, "255.255.252.0", "0.0.0.0")
        found["name"] = dcp.get_param(sock, source, mac, "name").decode()
        found["ip"] = list(dcp.get_param(sock, source, mac, "ip"))
        found["signalled"] = dcp.signal_device(sock, source, mac)
    found["found"] = by_name(name).ip
    return found


def reset(mac, mode):
    with ethernet_socket(INTERFACE) as sock:
        return dcp.reset_to_factory(sock, get_mac(INTERFACE), mac, int(mode, 16))


def im0(record):
    return {
        "order": record.order_id.decode().strip() if isinstance(record.order_id, bytes) else record.order_id,
        "vendor": record.vendor_id_high << 8 | record.vendor_id_low,
        "serial": str(record.im_serial_number),
    }


def acyclic(station):
    """Everything without cyclic data: the endpoint mapper, records with and without a connection."""
    device = by_name(station)
    found = {"endpoints": [(e.interface_name, e.port, e.annotation) for e in epm_lookup(device.ip)]}
    found["implicit_im0"] = device.read_implicit(0, 1, 0xAFF0).hex()
    with RPCCon(device._info, timeout=3) as connection:
        connection.connect(get_mac(INTERFACE))
        found["im0"] = im0(connection.read_im0())
        found["slots"] = sorted({(s.slot, s.subslot) for s in connection.discover_slots()})
    return found


def slots(gsdml=None):
    """The drive as its description has it, telegram 1 in slot 1; or as its GSDML file says."""
    if gsdml is not None:
        return load_gsdml(gsdml).build_io_slots({1: "TELEGRAM_1"})
    dap = {"slot": 0, "module_ident": 1}
    drive = {"slot": 1, "module_ident": 0x00010001, "api": PROFIDRIVE}
    return [
        IOSlot(subslot=1, submodule_ident=1, **dap),
        IOSlot(subslot=0x8000, submodule_ident=2, **dap),
        IOSlot(subslot=0x8001, submodule_ident=3, **dap),
        IOSlot(subslot=1, submodule_ident=0xFFFF, **drive),
        IOSlot(subslot=2, submodule_ident=0x00020001, input_length=4, output_length=4, **drive),
    ]


def words(cyclic):
    data = cyclic.get_input_data(*TELEGRAM)
    return (None, None) if data is None else (int.from_bytes(data[:2]), int.from_bytes(data[2:], signed=True))


def wait(condition, seconds=3.0):
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True


def run(station, factor, ratio, seconds, gsdml=None):
    """A connection with cyclic data: up to S4 and turning, records beside it, then released."""
    factor, ratio, seconds = int(factor), int(ratio), float(seconds)
    device = by_name(station)
    # 1.6 s without a frame, near the most that the standard allows (1.92 s): a busy machine is not what this is about
    hold = int(1.6 / (factor * ratio * 31.25e-6))
    setup = IOCRSetup(
        slots=slots(gsdml), send_clock_factor=factor, reduction_ratio=ratio, watchdog_factor=hold, data_hold_factor=hold
    )
    found = {"cycle_seconds": setup.cycle_time_us / 1e6}
    began = time.monotonic()
    cyclic = device.start_cyclic(setup, max_consecutive_timeouts=0)
    found["connect_seconds"] = time.monotonic() - began
    states = []

    def command(stw1, speed=0):
        cyclic.set_output_data(*TELEGRAM, stw1.to_bytes(2) + speed.to_bytes(2, signed=True))

    # ZSW1 bits 0, 1, 2 and 6 are the state: S1 0x40, S2 0x01, S3 0x03, S4 0x07
    for stw1, zsw1 in ((0x0470, 0x40), (0x0476, 0x01), (0x0477, 0x03), (0x047F, 0x07)):
        command(stw1)
        wait(lambda zsw1=zsw1: words(cyclic)[0] is not None and words(cyclic)[0] & 0x47 == zsw1)
        states.append(words(cyclic)[0])
    found["states"] = states
    speed = 0x0800
    command(0x047F, speed)
    found["followed"] = wait(lambda: words(cyclic)[1] is not None and abs(words(cyclic)[1] - speed) < speed // 50)
    start, received, sent = time.monotonic(), cyclic.stats.frames_received, cyclic.stats.frames_sent
    time.sleep(seconds)
    passed = time.monotonic() - start
    found["received_per_second"] = (cyclic.stats.frames_received - received) / passed
    found["sent_per_second"] = (cyclic.stats.frames_sent - sent) / passed
    found["actual"], found["wanted"] = words(cyclic)[1], speed
    rpc = device._rpc
    found["im0"] = im0(rpc.read_im0())
    found["parameters"] = {}
    for index in (47, 0xB02E):
        rpc.write(api=PROFIDRIVE, slot=1, subslot=1, idx=index, data=READ_964)
        found["parameters"][index] = rpc.read(api=PROFIDRIVE, slot=1, subslot=1, idx=index).payload.hex()
    command(0x047E)
    found["stopped"] = wait(lambda: words(cyclic)[0] & 0x47 == 0x01)
    found["duplicates"] = cyclic.stats.frames_duplicate
    found["out_of_order"] = cyclic.stats.frames_out_of_order
    found["invalid"] = cyclic.stats.frames_invalid
    cyclic.stop()
    rpc.disconnect()
    device.close()
    return found


VERBS = {"discover": discover, "rename": rename, "reset": reset, "acyclic": acyclic, "run": run}

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    logging.basicConfig(level=logging.WARNING, stream=sys.stderr)
    print(json.dumps(VERBS[sys.argv[1]](*sys.argv[2:]), default=str))
