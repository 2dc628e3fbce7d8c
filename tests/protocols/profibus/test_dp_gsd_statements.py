"""GSD files as makers write them: comments, continuations, ends that were forgotten."""

import pytest

from pnfarm.errors import DecodeError
from pnfarm.protocols.profibus.gsd.statements import parse_gsd

HEAD = b"#Profibus_DP\r\nIdent_Number = 0x0A8E\r\n"


def modules(file):
    return [block.head.text() for block in file.blocks("module")]


def test_statements_are_read_with_comments_continuations_and_any_case():
    file = parse_gsd(HEAD + b'ext_user_prm_data_const(0) = 0x80,\\ ; three\r\n 0x00,0x00\r\nModel_Name = "a;b" ; c\r\n')
    assert file.entry("IDENT_NUMBER").number() == 0x0A8E
    assert file.entry("Ext_User_Prm_Data_Const").octets() == b"\x80\0\0"
    assert file.entry("Model_Name").text() == "a;b"
    assert file.warnings == ()


def test_a_file_without_its_first_line_is_none():
    with pytest.raises(DecodeError, match="no line is #Profibus_DP"):
        parse_gsd(b"Ident_Number = 1\n")


@pytest.mark.parametrize(
    "forgotten",
    [b"", b'PrmText = 1\nText(0) = "off"\n', b'ExtUserPrmData = 1 "x"\nUnsigned8 0 0-3\n',
     b"SlotDefinition\nPrmText = 1\n"],
)  # fmt: skip
def test_forgotten_ends_do_not_swallow_the_next_module(forgotten):
    file = parse_gsd(
        HEAD + b'Module = "one" 0xC1\n1\n' + forgotten + b'Module = "two" 0xC2\n2\nEndModule\nRevision = 3\n'
    )
    assert modules(file) == ["one", "two"]
    assert file.entry("Revision").number() == 3
    assert any("Module has no end" in warning.text for warning in file.warnings)


def test_blocks_in_blocks_are_closed_by_their_own_ends():
    file = parse_gsd(
        HEAD + b'SlotDefinition\nSlot(1) = "a" 1 1\nEndSlotDefinition\nModule = "one" 0xC1\n1\nEndModule\n'
        b'UnitDiagType = 1\nX_Unit_Diag_Area = 0-7\nX_Value(1) = "x"\nX_Unit_Diag_Area_End\nEndUnitDiagType\n'
    )
    assert modules(file) == ["one"]
    assert [len(file.blocks(kind)) for kind in ("slotdefinition", "unitdiagtype")] == [1, 1]
    assert file.warnings == ()
