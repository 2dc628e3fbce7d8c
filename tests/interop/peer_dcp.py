"""pnio-dcp or profi-dcp against drives: ``peer_dcp.py LIBRARY VERBS``, a JSON list; the results as one line of JSON."""

# ruff: noqa: T201 - what it prints is its answer

import importlib
import json
import sys

OWN_ADDRESS = "10.77.3.200"
PATIENCE_SECONDS = 3


def shown(device):
    return {
        "name": device.name_of_station,
        "mac": device.MAC,
        "ip": device.IP,
        "mask": device.netmask,
        "family": device.family,
    }


def main():
    library, verbs = sys.argv[1], json.loads(sys.argv[2])
    module = importlib.import_module(f"{library}.{library}")
    client = module.DCP(OWN_ADDRESS)
    client.default_timeout = client.identify_all_timeout = PATIENCE_SECONDS
    results = []
    for verb, *arguments in verbs:
        try:
            result = getattr(client, verb)(*arguments)
        except Exception as exc:  # noqa: BLE001 - carried to the test
            results.append({"error": type(exc).__name__})
            continue
        if isinstance(result, list):
            results.append(sorted((shown(device) for device in result), key=lambda d: d["mac"]))
        elif hasattr(result, "get_message"):
            results.append({"ok": bool(result), "message": result.get_message()})
        else:
            results.append(shown(result) if hasattr(result, "MAC") else result)
    print(json.dumps(results))


if __name__ == "__main__":
    main()
