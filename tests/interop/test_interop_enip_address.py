"""Addresses of EtherNet/IP drives on real interfaces: another host has one first, or takes one that is in use."""

import pytest
from interop_rig import running

NAME, OWN = "axis-1", "10.77.0.11"
DRIVES = [f"{{name: {NAME}, model: akd-ethernetip, ip: {OWN}/22}}"]
#: The claim looks again after 10 to 13 s, and then for one more.
PATIENCE = 30.0
CONNECT = f"import socket; print(socket.create_connection(('{OWN}', 44818), 5).getpeername()[0])"
#: An announcement of the drive's address by the peer, and the answers within a second (RFC 5227).
ANNOUNCE = f"""
import socket, time
sock = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0806))
sock.bind(("plc0", 0x0806))
own = sock.getsockname()[4]
ip = socket.inet_aton("{OWN}")
head = bytes.fromhex("0001080006040001")
sock.send(b"\\xff" * 6 + own + bytes.fromhex("0806") + head + own + ip + bytes(6) + ip)
end, heard = time.monotonic() + 1.0, 0
while (left := end - time.monotonic()) > 0:
    sock.settimeout(left)
    try:
        frame = sock.recv(64)
    except TimeoutError:
        break
    heard += frame[6:12] != own and frame[28:32] == ip == frame[38:42]
print(heard)
"""


@pytest.fixture
def taken(lab):
    """The peer has the drive's address."""
    lab.run("peer", "ip", "address", "add", f"{OWN}/32", "dev", "plc0")
    yield
    lab.run("peer", "ip", "address", "del", f"{OWN}/32", "dev", "plc0", check=False)


def happened(text):
    return lambda log: any(entry["event"] == text for entry in log)


def test_a_drive_takes_no_address_that_another_host_has_until_that_is_gone(lab, tmp_path, taken):
    with running(lab, tmp_path, DRIVES) as farm:
        farm.until(happened("address not used"), "events", name=NAME)
        assert farm.ask("view", name=NAME)["ip_conflict"]
        assert OWN not in lab.run("farm", "ip", "-o", "address").stdout
        lab.run("peer", "ip", "address", "del", f"{OWN}/32", "dev", "plc0")
        farm.until(happened("address conflict over"), "events", PATIENCE, name=NAME)
        assert lab.run("peer", "python3", "-c", CONNECT).stdout.strip() == OWN


def test_a_drive_defends_an_address_that_another_host_announces_and_goes_on(lab, tmp_path):
    with running(lab, tmp_path, DRIVES) as farm:
        farm.until(lambda _: OWN in lab.run("farm", "ip", "-o", "address").stdout, "events", name=NAME)
        assert int(lab.run("peer", "python3", "-c", ANNOUNCE).stdout) >= 1
        farm.until(happened("address conflict"), "events", name=NAME)
        assert lab.run("peer", "python3", "-c", CONNECT).stdout.strip() == OWN
