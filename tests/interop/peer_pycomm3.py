"""PyPI's ``pycomm3`` as explicit client: ``python peer_pycomm3.py ADDRESS INSTANCE``.

Identity, attributes of three classes over UCMM and over a class 3 connection.  Prints one line of JSON.
"""

# ruff: noqa: T201 - what it prints is its answer

import json
import sys

from pycomm3 import DINT, SHORT_STRING, UDINT, UINT, CIPDriver

GET, SET = 0x0E, 0x10
TARGET_POSITION, GENERAL_FAULT = 6, 5


def main():
    address, instance = sys.argv[1], int(sys.argv[2])
    identity = CIPDriver.list_identity(address)

    with CIPDriver(address) as driver:

        def ask(service, where, data=b"", kind=None, *, connected):
            # its own route path would make a request to another module of a rack
            route = {} if connected else {"route_path": False}
            tag = driver.generic_message(
                service, *where, request_data=data, data_type=kind, connected=connected, **route
            )
            return tag.error or (True if service == SET else tag.value)

        def both_ways(connected, position, ramp):
            controller, parameter = (0x25, 1, TARGET_POSITION), (0x0F, instance, 1)
            return {
                "name": ask(GET, (1, 1, 7), kind=SHORT_STRING, connected=connected),
                "vendor": ask(GET, (1, 1, 1), kind=UINT, connected=connected),
                "position set": ask(SET, controller, DINT.encode(position), connected=connected),
                "position": ask(GET, controller, kind=DINT, connected=connected),
                "parameter set": ask(SET, parameter, UDINT.encode(ramp), connected=connected),
                "parameter": ask(GET, parameter, kind=UDINT, connected=connected),
                "fault": ask(GET, (0x24, 1, GENERAL_FAULT), connected=connected)[0],
                "no such attribute": ask(GET, (0x25, 1, 99), connected=connected),
                "not settable": ask(SET, (0x25, 1, 58), b"\1", connected=connected),
                "too short": ask(SET, controller, b"\1", connected=connected),
                "no such object": ask(GET, (0x99, 1, 1), connected=connected),
            }

        seen = {
            "identity": {key: str(value) for key, value in identity.items()},
            "unconnected": both_ways(False, 12345, 20000),
            "connected": both_ways(True, -54321, 30000),
        }
    print(json.dumps(seen))


if __name__ == "__main__":
    main()
