"""PyPI's ``ethernetip`` as scanner: ``python peer_ethernetip.py SECONDS MULTIPLIER ADDRESS ...``.

A session, the identity and a cyclic connection at 10 ms with each drive; the Enable bit is set.  Prints what it saw as
one line of JSON.
"""

# ruff: noqa: T201 - what it prints is its answer

import json
import sys
import time

from ethernetip.ethernetip import EtherNetIP

CONFIGURATION, COMMAND, RESPONSE = 100, 101, 102
OCTETS = 64
RPI_MS = 10
ENABLE_BIT = 7
PATIENCE = 10.0


def octets_of(bits):
    return bytes(sum(bool(bits[8 * n + k]) << k for k in range(8)) for n in range(len(bits) // 8))


def prepare(scanner, address):
    """A session; the connection and the bits that it will receive."""
    connection = scanner.explicit_conn(address)
    assert connection.registerSession() == 0
    inputs = scanner.registerAssembly(EtherNetIP.ENIP_IO_TYPE_INPUT, OCTETS, RESPONSE, connection)
    outputs = scanner.registerAssembly(EtherNetIP.ENIP_IO_TYPE_OUTPUT, OCTETS, COMMAND, connection)
    outputs[ENABLE_BIT] = True
    return connection, inputs


def start(connection, multiplier):
    status = connection.sendFwdOpenReq(
        RESPONSE, COMMAND, CONFIGURATION, multiplier=multiplier, torpi=RPI_MS, otrpi=RPI_MS
    )
    assert status == 0, f"{connection.ipaddr}: Forward_Open was refused with {status}"


def main():
    seconds, multiplier, *addresses = sys.argv[1:]
    # each connection has a thread: let them take turns often
    sys.setswitchinterval(0.0005)
    scanner = EtherNetIP()
    scanner.startIO()
    seen = {}
    try:
        found = {address: scanner.listIDUDP(address) for address in addresses}
        # first all of them: its listening thread goes through a table that must not grow meanwhile
        opened = {address: prepare(scanner, address) for address in addresses}
        for connection, _ in opened.values():
            start(connection, int(multiplier))
            connection.produce()
        time.sleep(float(seconds))
        end = time.monotonic() + PATIENCE
        # its one listening thread may be behind the others' data
        while time.monotonic() < end and not all(inputs[ENABLE_BIT] for _, inputs in opened.values()):
            time.sleep(0.05)
        for address, (connection, inputs) in opened.items():
            error, name = connection.getAttrSingle(1, 1, 7)
            seen[address] = {
                "listed": found[address].product_name.decode(),
                "name": name[1:].decode() if name else error,
                "inputs": octets_of(inputs).hex(),
                "sent": connection.seqnum,
            }
        for address, (connection, _) in opened.items():
            connection.stopProduce()
            seen[address]["closed"] = connection.sendFwdCloseReq(RESPONSE, COMMAND, CONFIGURATION) == 0
            connection.unregisterSession()
    finally:
        for connection in scanner.explicit:
            connection.stopProduce()
        scanner.stopIO()
    print(json.dumps(seen))


if __name__ == "__main__":
    main()
