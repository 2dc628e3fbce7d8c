"""A user's list of parameters: what its rows add to a model, and what is wrong with them, line by line."""

from __future__ import annotations

import pytest
from drives_kit import refused
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.drives.axis_handle import AxisHandle
from pnfarm.drives.catalogue import model, models
from pnfarm.drives.description.as_json import as_json
from pnfarm.drives.description.behaviour import with_behaviour
from pnfarm.drives.description.motor_kinds import with_motor
from pnfarm.drives.description.numbering import read_number, read_numbering
from pnfarm.drives.description.parts import Effect, Fact
from pnfarm.drives.description.sections import Section
from pnfarm.drives.parameters.effects import effect_of
from pnfarm.drives.parameters.parameter import Form, ParameterErrorNumber, ParameterType
from pnfarm.drives.parameters.store import ParameterStore
from pnfarm.drives.parameters.user_list import COLUMNS, MAX_PARAMETERS, MAX_PROBLEMS, read_parameter_list
from pnfarm.errors import ConfigError
from pnfarm.firmware.axis import AXIS
from pnfarm.table.image import IMAGE

E1 = model("hiwin-e1")
E = ParameterErrorNumber


def listed(text: str, name: str = "hiwin-e1"):
    described, problems = read_parameter_list(text, model(name), "list.csv")
    assert problems == []
    return described


def added(text: str, name: str = "hiwin-e1"):
    return {pnu: p for pnu, p in listed(text, name).parameters.items() if pnu not in model(name).parameters}


def wrong(text: str, name: str = "hiwin-e1") -> list[tuple[int, str, str]]:
    return [(p.line, p.column, p.what) for p in read_parameter_list(text, model(name), "list.csv")[1]]


def store_of(text: str, name: str = "hiwin-e1") -> ParameterStore:
    store = ParameterStore(listed(text, name), AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    store.power_on()
    return store


# what a row adds


def test_a_number_alone_is_a_kept_word_that_outlives_a_power_cycle():
    """HIWIN E1 4.2: every Pt parameter has the PNU 2000h + its number."""
    store = store_of("number\nPt200\n")
    parameter = store.model.parameters[0x2200]
    assert (parameter.name, parameter.type, parameter.signed) == ("Pt200", ParameterType.WORD, False)
    assert (parameter.minimum, parameter.maximum, parameter.default, parameter.nonvolatile) == (0, 65535, 0, True)
    assert effect_of(store.model, parameter) is Effect.KEPT
    assert parameter.source == parameter.values_source == "list.csv:2"
    store.set("Pt200", 40_000)
    store.power_on()
    assert store.get("0x2200") == 40_000, "the E1 saves at once"


def test_each_column_sets_its_part():
    store = store_of(
        "number,name,type,access,min,max,default,unit,nonvolatile,note\n"
        "Pt210,Speed loop gain,uint16,rw,10,0x4E20,400,0.1 Hz,no,remark\n"
        "0x2211,,int32,r,-5,5,,,,\n"
    )
    gain, offset = store.model.parameters[0x2210], store.model.parameters[0x2211]
    assert (gain.minimum, gain.maximum, gain.default, gain.unit) == (10, 20_000, 400, "0.1 Hz")
    assert (gain.name, gain.nonvolatile, gain.note) == ("Speed loop gain", False, "remark")
    assert (offset.name, offset.type, offset.signed, offset.writable) == ("Pt211", ParameterType.DWORD, True, False)
    assert effect_of(store.model, offset) is Effect.CONSTANT
    for written in ("speed loop gain", "Pt210", "0x2210", "2210h", 8720):
        assert store.model.resolve(written)[0] is gain
    refused(E.LIMIT_EXCEEDED, lambda: store.set("Pt210", 9))
    refused(E.NOT_CHANGEABLE, lambda: store.set("Pt211", 0))
    store.set("Pt210", 500)
    store.power_on()
    assert store.get("Pt210") == 400, "it is not kept without power"


@pytest.mark.parametrize(
    "text",
    [
        "number;min;max;default\nPt230;10;20000;400\n",
        "Max, MIN ,default,number,\n20000,10,400,8752,\n",
        "# from the book\n\nnumber,min,max,default\n  # gains\nPt230,10,20000,0x190\n",
        'number,min,max,default\r\n"2230h","10","20000","400"\r\n',
    ],
    ids=["semicolons", "any order", "comments", "quotes"],
)
def test_lists_are_read_as_spreadsheets_and_people_write_them(text: str):
    parameter = added(text)[0x2230]
    assert (parameter.minimum, parameter.maximum, parameter.default) == (10, 20_000, 400)


def test_a_default_left_out_is_0_or_the_limit_next_to_it():
    found = added("number,type,min,max\nPt200,int16,-9,-3\nPt201,,5,9\nPt202,int8,,\n")
    assert [found[pnu].default for pnu in (0x2200, 0x2201, 0x2202)] == [-3, 5, 0]
    assert (found[0x2202].minimum, found[0x2202].maximum) == (-128, 127)


def test_a_run_leaves_out_what_the_model_has_and_what_has_a_row_of_its_own():
    found = added("number,max\nPt300..Pt31F,99\nPt300,7\n")
    own = {pnu for pnu in E1.parameters if 0x2300 <= pnu <= 0x231F}
    assert own == {0x230A, 0x2316, 0x2317}
    assert set(found) == set(range(0x2300, 0x2320)) - own
    assert (found[0x2300].maximum, found[0x2301].maximum) == (7, 99)
    assert (found[0x2301].name, found[0x2301].source) == ("Pt301", "list.csv:2")


def test_one_run_makes_every_pt_parameter_accessible():
    described = listed("number\nPt000..PtFFF\n")
    store = ParameterStore(described, AxisHandle(AXIS.allocate(1)[0], IMAGE.allocate(1)[0]))
    store.power_on()
    for number in range(0x1000):
        parameter = described.resolve(f"Pt{number:03X}")[0]
        assert parameter.pnu == 0x2000 + number
        assert store.get(parameter.pnu) == parameter.default


def test_a_float_is_kept_as_the_bits_of_its_number():
    store = store_of("number,name,type,default\n3000,Gain,float,-0.5\n", "moog-msd")
    parameter = store.model.parameters[3000]
    assert (parameter.form, parameter.name, parameter.default) == (Form.FLOAT, "Gain", 0xBF000000)
    assert store.get("P-3000") == store.get("gain") == 0xBF000000


@pytest.mark.parametrize("name", sorted(models()))
def test_every_model_takes_a_list_with_each_motor_and_reading(name: str):
    described = listed("number,default\n20000,5\n", name)
    for kind in (None, *described.motor_kinds):
        with_kind = with_motor(described, kind, None)
        for point in described.behaviour:
            for reading in point.readings:
                chosen = with_behaviour(with_kind, {point.name: reading})
                assert chosen.parameters[20000].default == 5
    (row,) = [row for row in as_json(described)["parameters"] if row["pnu"] == 20000]
    assert (row["effect"], row["source"]) == ("kept", "list.csv:2")


def test_defined_parameters_are_shown_with_the_listed_ones():
    """PNU 980 on: every array ends with the number of the next one."""
    store = store_of("number\n10000..10005\n", "akd-profinet")
    told = {number for pnu in range(980, 990) for number in store.read(pnu, 0, 117)}
    assert {*range(10000, 10006)} <= told


# what is wrong


@pytest.mark.parametrize(
    ("text", "problems"),
    [
        ("", [(1, "", "has no column number")]),
        ("name\nx\n", [(1, "", "has no column number")]),
        ("number,defualt\nPt200,1\n", [(1, "", "'defualt' is not a column")]),
        ("number,min,MIN\n", [(1, "min", "is given twice")]),
        ("number\n\n# x\nPt20G\n", [(4, "number", "'Pt20G' is not the number of a parameter")]),
        ("number,max\n,5\n", [(2, "number", "is empty")]),
        ("number\n0\n65536\nPt1000\n", [
            (2, "number", "'0' is not the number of a parameter"),
            (3, "number", "'65536' is not the number of a parameter"),
            (4, "number", "'Pt1000' is not the number of a parameter"),
        ]),
        ("number\nPt317\n", [(2, "number", "hiwin-e1 has Pt317 itself")]),
        ("number\nPt200\n8704\n", [(3, "number", "Pt200 is already given in line 2")]),
        ("number\nPt200..Pt20F\nPt20F..Pt21F\n", [(3, "number", "Pt20F is already given in line 2")]),
        ("number\nPt20F..Pt200\n", [(2, "number", "'Pt20F..Pt200' is not a run of parameters")]),
        ("number\nPt316..Pt318\nPt318\n", [(2, "number", "'Pt316..Pt318' adds no parameter")]),
        ("number\nPt200..\n", [(2, "number", "is empty")]),
        ("number\n1..9000\n", [(2, "number", "'1..9000' is not a run of parameters")]),
        ("number,name\nPt200..Pt201,x\n", [(2, "name", "names more than one parameter")]),
        ("number,name\nPt200,922\n", [(2, "name", "'922' is a number of a parameter")]),
        ("number,name\nPt200,947.3\n", [(2, "name", "'947.3' is a number of a parameter")]),
        ("number,name\nPt200,pt201\n", [(2, "name", "'pt201' is a number of a parameter")]),
        ("number,name\nPt200,a\x1b[2J\n", [(2, "name", "has control characters")]),
        ("number,type\nPt200,bool\n", [(2, "type", "'bool' is not a type")]),
        ("number,access\nPt200,w\n", [(2, "access", "is 'w'")]),
        ("number,nonvolatile\nPt200,maybe\n", [(2, "nonvolatile", "is 'maybe'")]),
        ("number,min,max\nPt200,9,5\n", [(2, "max", "5 is below min, 9")]),
        ("number,min\nPt200,x\n", [(2, "min", "is 'x'")]),
        ("number,min\nPt200,--1\n", [(2, "min", "is '--1'")]),
        ("number,max\nPt200,65536\n", [(2, "max", "is '65536'")]),
        ("number,min,max,default\nPt200,1,5,6\n", [(2, "default", "is '6'")]),
        ("number,type,default\nPt200,float,1e99\n", [(2, "default", "is '1e99'")]),
        ("number,type,default\nPt200,float,nan\n", [(2, "default", "is 'nan'")]),
        ("number,type,min\nPt200,float,1\n", [(2, "min", "is given for a float")]),
        ("number,max\nPt200,5,6,7\n", [(2, "", "has 4 cells")]),
        ('number,note\nPt200,"x\n', [(2, "", "cannot be read: unexpected end of data")]),
        ('number,note\nPt200,"x\ny"\nPt20x\n', [(4, "number", "'Pt20x' is not the number of a parameter")]),
    ],
)  # fmt: skip
def test_what_is_wrong_is_reported_with_its_line_and_column(text: str, problems: list[tuple[int, str, str]]):
    assert wrong(text) == problems
    assert all(problem.allowed for problem in read_parameter_list(text, E1, "list.csv")[1])


def test_a_parameter_that_is_there_with_another_reading_only_cannot_be_listed():
    absent = with_behaviour(E1, {"profile-parameters": "listed-only"})
    assert 965 not in absent.parameters
    (problem,) = read_parameter_list("number\n965\n", absent, "list.csv")[1]
    assert problem.what == "hiwin-e1 has 965 itself"


def test_every_wrong_line_is_reported_in_the_files_order_and_the_others_count():
    described, problems = read_parameter_list("number,max\nPt20F..Pt200,\nPt200,x\nPt201,5\n", E1, "list.csv")
    assert [problem.line for problem in problems] == [2, 3]
    assert described.parameters[0x2201].maximum == 5
    assert 0x2200 not in described.parameters


def test_a_list_has_bounds():
    text = "number\n" + "".join(f"{20_000 + n}\n" for n in range(MAX_PARAMETERS + 1))
    assert wrong(text) == [(MAX_PARAMETERS + 2, "number", "makes the list too long")]
    assert len(wrong("number\n" + "x\n" * 10_000)) == MAX_PROBLEMS
    assert len(wrong("number\n" + "Pt317..Pt317\n" * 10_000)) == MAX_PROBLEMS
    (problem,) = wrong(f"number\n{'9' * 10_000}\n")
    assert len(problem[2]) < 100


@pytest.mark.parametrize("name", sorted(models()))
@given(text=st.one_of(st.text(), st.lists(
    st.lists(st.sampled_from([*COLUMNS, "Pt200", "Pt200..Pt20F", "922", "5", "-5", "x", "", "float"]), max_size=6)
    .map(",".join), max_size=6).map("\n".join)))  # fmt: skip
def test_any_text_is_a_list_or_has_problems(name: str, text: str):
    described, problems = read_parameter_list(text, model(name), "list.csv")
    for problem in problems:
        assert problem.line >= 1
        assert problem.column in {"", *COLUMNS}
    assert list(described.parameters) == sorted(described.parameters)
    for pnu, parameter in described.parameters.items():
        assert described.resolve(str(pnu))[0] is parameter
        assert parameter.source != "list.csv" or parameter.allows(parameter.default)


# numbers as makers write them


@pytest.mark.parametrize(
    ("name", "pnu", "written"),
    [
        ("hiwin-e1", 0x2100, "Pt100"),
        ("hiwin-e1", 0x2001, "Pt001"),
        ("hiwin-e1", 0x230A, "Pt30A"),
        ("hiwin-e1", 922, ""),
        ("hiwin-e1", 61000, ""),
        ("moog-msd", 930, "P-0930"),
        ("moog-msd", 1290, "P-1290"),
        ("akd-profinet", 2100, ""),
    ],
)
def test_a_number_is_written_as_its_maker_does(name: str, pnu: int, written: str):
    numbering = model(name).numbering
    assert numbering.name(pnu) == written
    for form in numbering.names(pnu):
        assert numbering.number(form) == numbering.number(form.lower()) == pnu
        assert model(name).resolve(form)[0].pnu == pnu


@pytest.mark.parametrize(
    ("text", "number"),
    [("8448", 8448), ("0x2100", 8448), ("2100h", 8448), ("0X2100", 8448), ("", None), ("-1", None), ("h", None),
     ("x2100", None), ("0x", None), ("1" * 99, None), ("٣", None)],
)  # fmt: skip
def test_numbers_are_read_as_manuals_print_them(text: str, number: int | None):
    assert read_number(text) == number


@pytest.mark.parametrize(
    ("fields", "key"),
    [
        ({"radix": 8}, "radix"),
        ({"base": 1}, "highest"),
        ({"base": -1}, "base"),
        ({"highest": "FFF"}, "highest"),
        ({"digits": True}, "digits"),
        ({"prefix": 5}, "prefix"),
    ],
)
def test_an_impossible_numbering_of_a_model_is_reported_by_its_key(fields: dict[str, object], key: str):
    facts = {name: Fact(value, "x") for name, value in fields.items()}
    with pytest.raises(ConfigError, match=rf"^model\.toml, numbering\.{key}: "):
        read_numbering(Section("numbering", facts, lambda section, key: f"model.toml, {section}.{key}"))
