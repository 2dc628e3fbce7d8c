"""profinet-py against a drive: ``peer_profinet_py.py VERB STATION [OPTION ...]``; what it found as one line of JSON."""

# ruff: noqa: T201 - what it prints is its answer

import dataclasses
import json
import logging
import sys
import time
import warnings

from profinet import IOCRSetup, IOSlot, ProfinetDevice, dcp, scan
from profinet.exceptions import PNIOError, RPCFaultError
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
    # the time over which the rate of frames is counted
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


def plain(value):
    """Something that JSON can hold, of whatever the package answers."""
    if isinstance(value, bytes):
        return value.hex()
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, tuple) and hasattr(value, "_fields"):
        return {name: plain(getattr(value, name)) for name in value._fields}
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple, set)):
        return [plain(item) for item in value]
    return value if isinstance(value, (str, int, float, bool, type(None))) else str(value)


def tried(what, *arguments, **named):
    """What a function of the package answers, or which error it makes of the drive's answer."""
    try:
        return plain(what(*arguments, **named))
    except PNIOError as exc:
        codes = (exc.error_code, exc.error_decode, exc.error_code1, exc.error_code2)
        return {"pnio": "".join(f"{code:02x}" for code in codes), "text": str(exc)}
    except RPCFaultError as exc:
        return {"fault": str(exc)}


def im_text(number, text, length):
    """An I&M record: block header and text. The package's own writers put two octets between them, which none has."""
    return (0x20 + number).to_bytes(2) + (length + 2).to_bytes(2) + b"\1\0" + text.encode().ljust(length)


def texts(station):
    """I&M1 to 4 written, read back, and what it makes of one that a drive has not."""
    with by_name(station) as device:
        found = {"own writer": tried(device.write_im1, "pump 3", "hall 7")}
        device.write(0, 1, 0xAFF1, im_text(1, "pump 3".ljust(32) + "hall 7", 54))
        device.write(0, 1, 0xAFF2, im_text(2, "2026-01-31 10:00", 16))
        device.write(0, 1, 0xAFF3, im_text(3, "the third pump", 54))
        device.write(0, 1, 0xAFF4, im_text(4, "signed", 54))
        for number in range(6):
            found[f"im{number}"] = tried(getattr(device, f"read_im{number}"))
        found["all"] = sorted(device.read_all_im())
        return found


def places(station):
    """What it finds of slots, differences, the log, the port and the neighbour."""
    with by_name(station) as device:
        device.connect()
        rpc = device._rpc
        names = (
            "discover_slots", "read_real_identification_data", "read_inm0filter", "read_module_diff", "read_logbook",
            "read_ar_info", "read_pd_real_data", "read_topology", "read_all_diagnosis", "read_diagnosis",
        )  # fmt: skip
        found = {name: tried(getattr(rpc, name)) for name in names}
        found["interface"] = tried(rpc.read_interface_info)
        found["port"] = tried(rpc.read_port_info, 0, 0x8001)
        found["statistics"] = tried(rpc.read_port_statistics, 0, 0x8001)
        found["indices"] = tried(rpc.enumerate_indices)
        found["records"] = tried(rpc.enumerate_records)
        found["scan"] = tried(rpc.scan_slots, 2)
        found["info"] = tried(device.get_info, include_topology=True)
        return found


def refusals(station):
    """Wrong places, indices and lengths, and writes in one call, with the codes that it makes of them."""
    with by_name(station) as device:
        device.connect()
        rpc = device._rpc
        return {
            "no such index": tried(rpc.read, 0, 0, 1, 0x1234),
            "no such slot": tried(rpc.read, 0, 9, 1, 0xAFF0),
            "no such subslot": tried(rpc.read, 0, 0, 77, 0xAFF0),
            "no such api": tried(rpc.read, 0x1111, 1, 1, 47),
            "nothing asked yet": tried(rpc.read, PROFIDRIVE, 1, 1, 47),
            "too short": tried(rpc.write, 0, 0, 1, 0xAFF1, b"12"),
            "read only": tried(rpc.write, 0, 0, 1, 0xAFF0, bytes(60)),
            "no such index to write": tried(rpc.write, 0, 0, 1, 0x1234, b"x"),
            "implicit": tried(rpc.read_implicit, 0, 9, 1, 0xAFF0),
        }


def described(path):
    """What its GSDML reader makes of a file."""
    return plain(load_gsdml(path))


def listen(station, *_):
    """A connection with cyclic data and its listener for alarms, while somebody tells it on standard input what to do.

    Each line is a call of the connection: ``["alarms"]``, ``["read_all_diagnosis"]``, ``["read_module_diff"]`` ...;
    the answer is a line, too.
    """
    device = by_name(station)
    alarms = []
    device.on_alarm(lambda alarm: alarms.append(plain(alarm)))
    hold = int(1.6 / (32 * 8 * 31.25e-6))
    setup = IOCRSetup(
        slots=slots(), send_clock_factor=32, reduction_ratio=8, watchdog_factor=hold, data_hold_factor=hold
    )
    cyclic = device.start_cyclic(setup, max_consecutive_timeouts=0)
    print(json.dumps("up"), flush=True)
    for line in sys.stdin:
        name, *arguments = json.loads(line)
        if name == "alarms":
            wanted = arguments[0]
            wait(lambda wanted=wanted: len(alarms) >= wanted, 5)
            answer = list(alarms)
        elif name == "input":
            *place, there = arguments
            # the next frame may still be on its way
            wait(lambda place=place, there=there: (cyclic.get_input_data(*place) is not None) == there, 5)
            answer = plain(cyclic.get_input_data(*place))
        else:
            answer = tried(getattr(device._rpc, name), *arguments)
        print(json.dumps(answer, default=str), flush=True)
    cyclic.stop()
    device._rpc.disconnect()
    device.close()
    return "released"


VERBS = {
    verb.__name__: verb for verb in (discover, rename, reset, acyclic, run, texts, places, refusals, described, listen)
}

if __name__ == "__main__":
    warnings.simplefilter("ignore")
    logging.basicConfig(level=logging.WARNING, stream=sys.stderr)
    print(json.dumps(VERBS[sys.argv[1]](*sys.argv[2:]), default=str))
