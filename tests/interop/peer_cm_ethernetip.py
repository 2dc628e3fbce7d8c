"""PyPI's ``cm-ethernetip`` as scanner: ``python peer_cm_ethernetip.py SECONDS MULTIPLIER ADDRESS ...``.

A session and a cyclic connection at 10 ms with each drive, with the Enable bit set; beside them requests over a
class 3 connection.  The package is also named ``ethernetip``, so it has a folder of its own
(see ``locks/apart.txt``).  Prints what it saw as one line of JSON.
"""

# ruff: noqa: T201 - what it prints is its answer

import asyncio
import json
import sys
from pathlib import Path

sys.path.insert(0, str(Path(sys.prefix) / "apart"))

from ethernetip.protocol.eip_scanner import EipScanner
from ethernetip.protocol.eip_udp_transport import IO_PORT, EipUdpTransport
from ethernetip.protocol.forward_open_config import ForwardOpenConfig

ENABLE = 0x80
OCTETS = 64
SEQUENCE = 2
GET_ATTRIBUTE_SINGLE = 0x0E
PRODUCT_NAME = bytes.fromhex("200124013007")


async def connect(address, multiplier, udp, number):
    scanner = EipScanner()
    await scanner.connect(address)
    # of its own it listens at a port that it tells nobody
    await scanner.udp.close()
    scanner._udp = udp
    # all of them number their connections from 1, and a shared transport knows a connection by its number
    scanner._next_conn_serial = number
    # its sizes are without the sequence count; what it sends and receives has one
    config = ForwardOpenConfig(
        consumed_assembly=101,
        produced_assembly=102,
        config_assembly=100,
        consumed_size=OCTETS + SEQUENCE,
        produced_size=OCTETS + SEQUENCE,
        rpi=10_000,
        timeout_multiplier=multiplier,
    )
    connection = await scanner.forward_open(config)
    connection._consumed_data = bytearray(OCTETS)
    connection.write_dint(0, ENABLE)
    return scanner, connection


async def name_of(scanner):
    """The product's name over a connection of class 3."""
    async with await scanner.open_explicit() as explicit:
        answer = await explicit.send_raw(GET_ATTRIBUTE_SINGLE, PRODUCT_NAME, b"")
    return answer.data[1:].decode()


async def main():
    seconds, multiplier, *addresses = sys.argv[1:]
    udp = EipUdpTransport(bind_port=IO_PORT)
    await udp.start()
    opened = {
        address: await connect(address, int(multiplier), udp, number) for number, address in enumerate(addresses, 1)
    }
    await asyncio.sleep(float(seconds))
    seen = {}
    for address, (scanner, connection) in opened.items():
        seen[address] = {
            "name": await name_of(scanner),
            "inputs": connection.produced_data[:OCTETS].hex(),
            "sent": connection.send_count,
            "received": connection.receive_count,
        }
    for scanner, connection in opened.values():
        await connection.close()
        await scanner.disconnect()
    await udp.close()
    print(json.dumps(seen))


if __name__ == "__main__":
    asyncio.run(main())
