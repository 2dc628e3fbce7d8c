"""PyPI's ``cpppo`` as explicit client: ``python peer_cpppo.py ADDRESS INSTANCE BROADCAST``.

ListIdentity by broadcast, attributes read and written one by one and many at once.  Prints one line of JSON.
"""

# ruff: noqa: T201 - what it prints is its answer

import json
import sys
import time

from cpppo.server.enip import client
from cpppo.server.enip.get_attribute import attribute_operations, proxy_simple

PATIENCE = 5.0
#: A drive answers a broadcast within the time that the context's first two octets grant, 500 ms at the least.
WITHIN_MS = 500
SPREAD = 3.0


def identities(broadcast):
    """Address and product name of each answer to a ListIdentity by broadcast."""
    found = {}
    with client.client(host=broadcast, udp=True, broadcast=True) as connection:
        connection.list_identity(timeout=PATIENCE, sender_context=WITHIN_MS.to_bytes(2, "little") + bytes(6))
        end = time.monotonic() + SPREAD
        while (left := end - time.monotonic()) > 0:
            answer, _ = client.await_response(connection, timeout=left)
            if not answer:
                break
            item = answer.enip.CIP.list_identity.CPF.item[0].identity_object
            found[str(item.sin_addr)] = item.product_name
    return found


def written(address, operations, **how):
    """The status of each answer and its values."""
    with client.connector(host=address, timeout=PATIENCE) as connection:
        return [
            [status, value]
            for _, _, _, _, status, value in connection.pipeline(
                operations=attribute_operations(operations, route_path=[], send_path=""), timeout=PATIENCE, **how
            )
        ]


def main():
    address, instance, broadcast = sys.argv[1:]
    writes = ["@0x25/1/6=(DINT)4711", f"@0x0F/{instance}/1=(UDINT)40000"]
    # the last one is refused: many at once, it would end cpppo's whole request
    reads = ["@0x25/1/6", f"@0x0F/{instance}/1", "@0x24/1/5", "@1/1/1", "@0x25/1/99"]
    via = proxy_simple(address)
    with via:
        identity, name = via.read(
            [("@1/1", ["INT", "INT", "INT", "INT", "INT", "DINT", "SSTRING", "USINT"]), ("@1/1/7", "SSTRING")]
        )
    via.close_gateway()
    seen = {
        "listed": identities(broadcast),
        "identity": identity,
        "name": name,
        "written": written(address, writes, depth=1),
        "one by one": written(address, reads, depth=1),
        "many at once": written(address, reads[:-1], depth=4, multiple=400),
    }
    print(json.dumps(seen, default=str))


if __name__ == "__main__":
    main()
