"""Every test of this folder is an interop test: somebody else's programs, most over real frames in real namespaces."""

import os
import sys

import pytest
from interop_rig import CannotRunError, Lab, running
from tools import needed

#: A foreign device that this project neither has nor fetches: where there is none, there is nothing to skip either.
collect_ignore = [] if os.environ.get("PNFARM_PNET") else ["test_interop_pnet.py", "test_interop_pnet_beside.py"]

#: Long enough for a busy machine, and whole numbers of what every peer can send.
DRIVES = [
    "{name: 'axis-{n:02}', count: 3, model: akd-profinet, ip: 10.77.0.11/22, limits: lax}",
]


def pytest_collection_modifyitems(items):
    for item in items:
        if "interop" in item.path.parts:
            item.add_marker(pytest.mark.interop)


@pytest.fixture
def tell(capsys):
    """Print a measured time, also of a test that passes."""

    def say(what, seconds):
        with capsys.disabled():
            sys.stdout.write(f"\n  {what}: {seconds:.4g} s\n")

    return say


@pytest.fixture(scope="module")
def lab():
    """Two joined namespaces for the tests of one module."""
    needed("ip", "nsenter")
    try:
        made = Lab()
    except CannotRunError as exc:
        pytest.skip(f"needs private network namespaces: {exc}")
    try:
        made.run("peer", "ip", "address", "add", "10.77.3.200/22", "dev", "plc0")
        yield made
    finally:
        made.close()


@pytest.fixture(scope="module")
def farm(lab, tmp_path_factory):
    """Three AKDs that take any cycle, at 10.77.0.11 to .13."""
    with running(lab, tmp_path_factory.mktemp("farm"), DRIVES) as worker:
        yield worker
