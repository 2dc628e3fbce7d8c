"""Whether every station of a farm exchanges data with a controller: the health check of the rig's controller.

``PNFARM_API`` and ``PNFARM_TOKEN`` or ``PNFARM_TOKEN_FILE`` name the farm, as for ``pnfarm inspect``.  Exit code 0: all
do; 1: some do not.
"""

from __future__ import annotations

import json
import os
import sys
import urllib.request
from pathlib import Path


def _kept(name: str | None) -> str:
    return Path(name).read_text("ascii").strip() if name else ""


def main() -> int:
    """Ask once."""
    api = os.environ.get("PNFARM_API", "http://127.0.0.1:8702").rstrip("/")
    try:
        token = os.environ.get("PNFARM_TOKEN") or _kept(os.environ.get("PNFARM_TOKEN_FILE"))
        headers = {"Authorization": f"Bearer {token}"} if token else {}
        request = urllib.request.Request(f"{api}/api/v1/stations", headers=headers)  # noqa: S310 - the farm's own address
        with urllib.request.urlopen(request, timeout=3) as answer:  # noqa: S310 - as above
            stations = json.load(answer)["stations"]
    except OSError as exc:  # no token file, connection refused, timeout, or an error response
        sys.stderr.write(f"the farm at {api} does not answer: {exc}\n")
        return 1
    missing = [one["name"] for one in stations if not one["connected"]]
    sys.stdout.write(f"{len(stations) - len(missing)} of {len(stations)} stations exchange data\n")
    return 1 if missing or not stations else 0


if __name__ == "__main__":
    sys.exit(main())
