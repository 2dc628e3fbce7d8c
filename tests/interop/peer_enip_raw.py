"""Octets of EtherNet/IP and ARP by hand: ``python peer_enip_raw.py VERB ...``; prints one line of JSON.

``arp FIRST COUNT``: who answers for each address.  ``refused ADDRESS``: messages that a drive refuses, and its answers.
``hostile SECONDS ADDRESS ...``: what no honest client does, all at once, to all of these drives.
"""

# ruff: noqa: T201 - what it prints is its answer

import contextlib
import json
import random
import selectors
import socket
import struct
import sys
import time
from ipaddress import IPv4Address

INTERFACE = "plc0"
PORT, IO_PORT = 44818, 2222
HEADER = struct.Struct("<HHII8sI")
NOP, LIST_IDENTITY, REGISTER, SEND_RR = 0x00, 0x63, 0x65, 0x6F
ARP_HEAD = bytes.fromhex("0001080006040001")
#: The random octets of one run are those of the next.
SEED = 14


def message(command, data=b"", session=0, *, length=None, status=0, options=0):
    return HEADER.pack(command, len(data) if length is None else length, session, status, b"raw peer", options) + data


def request(session, body):
    """A request without a connection, in SendRRData."""
    items = struct.pack("<IHHHHHH", 0, 5, 2, 0, 0, 0xB2, len(body))
    return message(SEND_RR, items + body, session)


def forward_open(serial, consumed=101, o_size=70, t_size=66, rpi_us=10_000, vendor=0xFFFE):
    path = bytes([0x20, 4, 0x24, 100, 0x2C, consumed, 0x2C, 102])
    head = struct.pack("<BBIIHHIB3x", 10, 5, 0, 0x70000000 + serial, serial & 0xFFFF, vendor, serial, 6)
    sizes = struct.pack("<IHIH", rpi_us, 0x4800 | o_size, rpi_us, 0x4800 | t_size)
    return bytes([0x54, 2, 0x20, 6, 0x24, 1]) + head + sizes + bytes([1, len(path) // 2]) + path


def read(sock):
    """One message: its status and its data."""
    data = b""
    while len(data) < HEADER.size or len(data) < HEADER.size + HEADER.unpack_from(data)[1]:
        got = sock.recv(4096)
        if not got:
            return None, b""
        data += got
    return HEADER.unpack_from(data)[3], data[HEADER.size :]


def session_with(address):
    sock = socket.create_connection((address, PORT), 5)
    sock.sendall(message(REGISTER, struct.pack("<HH", 1, 0)))
    header = sock.recv(4096)
    return sock, HEADER.unpack_from(header)[2]


# -- ARP ---------------------------------------------------------------------------------------------------------------


def arp(first, count):
    """MAC addresses that answered for each address within a second after the last question."""
    sock = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, socket.htons(0x0806))
    sock.bind((INTERFACE, 0x0806))
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 20)
    own, ip = sock.getsockname()[4], IPv4Address("10.77.3.200").packed
    addresses = [IPv4Address(first) + n for n in range(int(count))]
    found = {str(address): [] for address in addresses}
    for address in addresses:
        sock.send(b"\xff" * 6 + own + bytes.fromhex("0806") + ARP_HEAD + own + ip + bytes(6) + address.packed)
    end = time.monotonic() + 1.0
    while (left := end - time.monotonic()) > 0:
        sock.settimeout(left)
        try:
            frame = sock.recv(64)
        except TimeoutError:
            break
        if frame[20:22] == b"\0\2" and str(IPv4Address(frame[28:32])) in found:
            assert frame[6:12] == frame[22:28]
            found[str(IPv4Address(frame[28:32]))].append(frame[6:12].hex(":"))
    return found


# -- refusals ----------------------------------------------------------------------------------------------------------


def refused(address):
    """Encapsulation status, general status and extended status of the answers, by what was wrong."""
    sock, session = session_with(address)

    def ask(octets):
        sock.sendall(octets)
        status, data = read(sock)
        reply = data[16:]
        if not reply:
            return [status]
        return [status, reply[2], *struct.unpack_from(f"<{reply[3]}H", reply, 4)]

    wrong = {
        "command": message(0x1234),
        "session": request(session + 1, forward_open(1)),
        "items": message(SEND_RR, b"\0" * 7, session),
        "long": message(NOP, bytes(60_000)),
        "service": request(session, bytes([0x33, 2, 0x20, 1, 0x24, 1])),
        "size": request(session, forward_open(1, o_size=64)),
        "point": request(session, forward_open(2, consumed=99)),
        "short": request(session, forward_open(4)[:20]),
    }
    seen = {name: ask(octets) for name, octets in wrong.items()}
    sock.sendall(message(REGISTER, struct.pack("<HH", 1, 0)))
    seen["registered"] = [read(sock)[0]]
    sock.close()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.settimeout(5)
        udp.sendto(message(REGISTER, struct.pack("<HH", 1, 0)), (address, PORT))
        seen["by datagram"] = [HEADER.unpack_from(udp.recv(100))[3]]
    return seen


# -- a hostile client --------------------------------------------------------------------------------------------------


class Hostile:
    """Many bad clients of some drives in one process; never waits for an answer."""

    def __init__(self, addresses):
        self.addresses = addresses
        self.random = random.Random(SEED)
        self.readable = selectors.DefaultSelector()
        self.sockets = []
        self.sessions = {}
        self.done = dict.fromkeys(("connects", "floods", "datagrams", "octets", "replies", "closed"), 0)
        self.udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.udp.setblocking(False)
        self.serial = 0

    def connect(self, address):
        """A client that connects and says nothing, or half a message, or all of one, by octets."""
        sock = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        sock.setblocking(False)
        with contextlib.suppress(BlockingIOError):
            sock.connect((address, PORT))
        self.sockets.append(sock)
        self.readable.register(sock, selectors.EVENT_READ)
        self.done["connects"] += 1

    def close(self, sock):
        self.readable.unregister(sock)
        self.sockets.remove(sock)
        sock.close()
        self.done["closed"] += 1

    def speak(self, sock):
        """Something bad on one connection."""
        kinds = (self.garbage, self.oversize, self.slow, self.flood, self.half)
        try:
            self.done["octets"] += sock.send(self.random.choice(kinds)())
        except BlockingIOError:
            pass
        except OSError:
            self.close(sock)

    def garbage(self):
        return self.random.randbytes(self.random.randrange(1, 3000))

    def oversize(self):
        return message(SEND_RR, length=0xFFFF) + bytes(16_000)

    def slow(self):
        return message(REGISTER, struct.pack("<HH", 1, 0))[: self.random.randrange(1, 28)]

    def half(self):
        return message(REGISTER, struct.pack("<HH", 1, 0))

    def flood(self):
        """A session and a hundred requests for connections, of every kind, in one piece."""
        self.done["floods"] += 1
        octets = message(REGISTER, struct.pack("<HH", 1, 0))
        for _ in range(100):
            self.serial += 1
            session = self.random.randrange(1, 60)
            o_size = 70 if (consumed := self.random.choice((101, 101, 254, 255))) == 101 else 2
            octets += request(session, forward_open(self.serial, consumed, o_size))
        return octets

    def datagrams(self, address):
        for port, octets in (
            (IO_PORT, self.random.randbytes(self.random.randrange(1, 1400))),
            # the head of a cyclic packet with any connection id
            (IO_PORT, struct.pack("<HHHIIHH", 2, 0x8002, 8, self.random.getrandbits(32), 1, 0xB1, 70) + bytes(70)),
            (PORT, self.random.randbytes(self.random.randrange(1, 1400))),
            (PORT, message(LIST_IDENTITY)),
        ):
            with contextlib.suppress(BlockingIOError, ConnectionError):
                self.udp.sendto(octets, (address, port))
                self.done["datagrams"] += 1

    def empty(self):
        """Read what came; on every second connection never: its buffers fill."""
        for key, _ in self.readable.select(0):
            if key.fd % 2:
                continue
            try:
                got = key.fileobj.recv(65_536)
            except OSError:
                got = b""
            if got:
                self.done["replies"] += 1
            else:
                self.close(key.fileobj)

    def run(self, seconds):
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            for address in self.addresses:
                if len(self.sockets) < 400:
                    self.connect(address)
                    self.connect(address)
                for _ in range(5):
                    self.datagrams(address)
            for sock in self.random.sample(self.sockets, min(8, len(self.sockets))):
                self.speak(sock)
            self.empty()
            # a flood, but one that leaves the honest peers of a test some of the processor
            time.sleep(0.005)


def hostile(seconds, *addresses):
    bad = Hostile(addresses)
    bad.run(float(seconds))
    return bad.done | {"open": len(bad.sockets)}


VERBS = {"arp": arp, "refused": refused, "hostile": hostile}

if __name__ == "__main__":
    print(json.dumps(VERBS[sys.argv[1]](*sys.argv[2:])))
