"""Attributes that cannot be stored, and a service that would have to."""

from struct import pack

import pytest
from away_memory import Away
from peer import Rig

from pnfarm.protocols.enip.status import GeneralStatus


@pytest.mark.parametrize("known", [True, False])
def test_attributes_answer_that_they_could_not_be_stored(known):
    memory = Away()
    memory.known = known
    rig = Rig(memory=memory)
    peer = rig.peer
    peer.connect()
    wanted = ((0xF5, 10, b"\0"), (0xF5, 13, pack("<H", 30)), (0x48, 4, b"\x07"))
    before = [peer.get(cls, 1, attribute).data for cls, attribute, _ in wanted]
    memory.away = True
    for cls, attribute, data in wanted:
        assert peer.set(cls, 1, attribute, data).status == GeneralStatus.STORE_OPERATION_FAILURE
    assert [peer.get(cls, 1, attribute).data for cls, attribute, _ in wanted] == before
    memory.away = False
    for cls, attribute, data in wanted:
        assert peer.set(cls, 1, attribute, data).status == GeneralStatus.SUCCESS
        assert peer.get(cls, 1, attribute).data == data
