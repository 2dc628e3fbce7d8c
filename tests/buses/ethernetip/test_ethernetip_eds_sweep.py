"""Every EDS file at hand, with every connection.

``PNFARM_EDS_FILES`` names a folder with more files, such as ``python -m tests.public_eds`` fetches.
"""

import os
from pathlib import Path

import pytest
from eds_sweep import Sweep, eds_files

FOLDER = os.environ.get("PNFARM_EDS_FILES")
MORE = eds_files(Path(FOLDER)) if FOLDER else []
(EXAMPLE,) = eds_files(Path(__file__).parents[3] / "configs" / "eds")


def test_the_scanner_opens_every_connection_of_the_example():
    found = Sweep(EXAMPLE)
    assert found.findings == []
    # five that are offered, and the owner beside the listener
    assert (found.counts["connections"], found.counts["not offered"], found.counts["connected"]) == (6, 1, 6)


def test_the_sweep_finds_what_is_wrong(tmp_path):
    """So that the tests above can fail."""
    path = tmp_path / "wrong.eds"
    path.write_bytes(EXAMPLE.read_bytes().replace(b"Param9, , Assem102,     $", b"Param9, , Assem99,     $"))
    (finding,) = Sweep(path).findings
    assert finding.startswith("connections ['Connection2', ")


if MORE:

    @pytest.mark.parametrize("path", MORE, ids=[path.name for path in MORE])
    def test_another_makers_file_has_every_connection_opened(path):
        assert Sweep(path).findings == []
