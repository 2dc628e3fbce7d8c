"""Keys of a farm file that are set from outside: options, variables, arguments."""

import pytest
from farm_file import GOOD, parse

from pnfarm.farm.file.reading import FarmFileError, expand


def test_overrides_win_and_the_whole_file_is_checked_again():
    farm = parse(GOOD).with_overrides({"api": "off", "link.parent": "eth7", "realtime.cpu": 3, "drives[0].count": 2})
    assert (farm.api, farm.link.parent, farm.realtime.cpu, len(expand(farm))) == (None, "eth7", 3, 2)
    assert len(expand(parse(GOOD).with_overrides({}))) == 8


@pytest.mark.parametrize("text", ["runs #3", "2026", "null", "[a]: b"])
def test_an_override_is_the_text_that_was_given_whatever_it_is_in_yaml(text):
    assert parse(GOOD).with_overrides({"state": text}).state == text


def test_an_ipv6_address_is_given_to_a_file_without_an_api():
    farm = parse(GOOD.replace("api: 127.0.0.1:8702", "api: off")).with_overrides({"api": "[::1]:8702"})
    assert farm.api.listen == ("::1", 8702)


def test_a_wrong_override_names_where_it_comes_from():
    with pytest.raises(FarmFileError) as caught:
        parse(GOOD).with_overrides({"api": "nowhere"}, origin="PNFARM_UP_API")
    assert str(caught.value).startswith("PNFARM_UP_API: api.listen: 'nowhere' is not HOST:PORT")


@pytest.mark.parametrize("key", ["", "api.listen.x", "drives[9].count", "drives.x", "sate", "farm[0]"])
def test_an_override_of_no_key_is_refused(key):
    with pytest.raises(FarmFileError):
        parse(GOOD).with_overrides({key: 1})
