"""Attributes with an explicit client from PyPI: ``python peer_explicit.py CLIENT ADDRESS REQUESTS``.

CLIENT is ``unconnected`` or ``connected`` (pycomm3, with UCMM or a class 3 connection) or ``cpppo``.  REQUESTS is a
JSON object of lists: class, instance, attribute, for a write the octets in hexadecimal.  Prints one line of JSON: the
octets of each answer, ``""`` for a write, else its general status.
"""

# ruff: noqa: T201 - what it prints is its answer

import json
import sys

from cpppo.server.enip import client
from cpppo.server.enip.get_attribute import attribute_operations
from pycomm3 import CIPDriver
from pycomm3.cip import SERVICE_STATUS

GET, SET = 0x0E, 0x10
PATIENCE = 5.0


def by_pycomm3(address, requests, *, connected):
    numbers = {text: number for number, text in SERVICE_STATUS.items()}
    answers = {}
    with CIPDriver(address) as driver:
        for name, (class_code, instance, attribute, *data) in requests.items():
            # its own route path would make a request to another module of a rack
            tag = driver.generic_message(
                SET if data else GET,
                class_code,
                instance,
                attribute,
                request_data=bytes.fromhex(data[0]) if data else b"",
                connected=connected,
                **({} if connected else {"route_path": False}),
            )
            if tag.error is None:
                answers[name] = "" if data else bytes(tag.value).hex()
            else:
                answers[name] = numbers.get(tag.error.partition(":")[0].partition(" - ")[0], tag.error)
    return answers


def by_cpppo(address, requests):
    operations = []
    for class_code, instance, attribute, *data in requests.values():
        values = ",".join(map(str, bytes.fromhex(data[0]))) if data else ""
        operations.append(f"@{class_code}/{instance}/{attribute}" + (f"=(USINT){values}" if data else ""))
    answers = {}
    with client.connector(host=address, timeout=PATIENCE) as connection:
        asked = attribute_operations(operations, route_path=[], send_path="")
        found = connection.pipeline(operations=asked, timeout=PATIENCE, depth=1)
        for (name, request), (_, _, _, _, status, value) in zip(requests.items(), found, strict=True):
            written = len(request) > 3
            answers[name] = status or ("" if written else bytes(value).hex())
    return answers


def main():
    which, address, requests = sys.argv[1], sys.argv[2], json.loads(sys.argv[3])
    if which == "cpppo":
        answers = by_cpppo(address, requests)
    else:
        answers = by_pycomm3(address, requests, connected=which == "connected")
    print(json.dumps(answers))


if __name__ == "__main__":
    main()
