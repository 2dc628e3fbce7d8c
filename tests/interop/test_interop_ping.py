"""The operating system's own tools reach a drive: it answers ARP and echo requests as any host does."""

import re

from tools import needed


def test_a_drive_answers_ping_small_and_large(lab, farm):
    needed("ping")
    for octets in (56, 1400):
        done = lab.run("peer", "ping", "-c", 5, "-i", 0.05, "-W", 2, "-s", octets, "10.77.0.11")
        assert " 0% packet loss" in done.stdout, done.stdout
        assert f"{octets + 8} bytes from 10.77.0.11" in done.stdout


def test_a_drive_answers_a_ping_that_came_in_fragments(lab, farm):
    needed("ping")
    done = lab.run("peer", "ping", "-c", 3, "-i", 0.05, "-W", 2, "-s", 4000, "10.77.0.12")
    assert "4008 bytes from 10.77.0.12" in done.stdout


def test_each_drive_has_its_own_address_in_the_peers_neighbour_table(lab, farm):
    needed("ping")
    for drive in farm.ask("drives"):
        address = drive["ip"].split("/")[0]
        lab.run("peer", "ping", "-c", 1, "-W", 2, address)
        neighbour = lab.run("peer", "ip", "neigh", "show", address).stdout
        assert re.search(rf"lladdr {drive['mac']}\b", neighbour), neighbour


def test_nobody_answers_for_an_address_that_no_drive_has(lab, farm):
    needed("ping")
    done = lab.run("peer", "ping", "-c", 1, "-W", 1, "10.77.0.99", check=False)
    assert done.returncode == 1


def test_duplicate_address_detection_finds_a_drive(lab, farm):
    assert lab.peer_json("peer_raw.py", "arp", "10.77.0.11") == farm.ask("drive", name="axis-01")["mac"]
    assert lab.peer_json("peer_raw.py", "arp", "10.77.0.99") is None
