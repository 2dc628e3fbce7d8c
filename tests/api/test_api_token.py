"""The API's token: given, kept in a file, or made; and who may read it."""

import os
import stat

import pytest

from pnfarm.api.access.token import token_of
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.file.reading import FarmFileError, parse_farm

GIVEN = "a-long-secret"  # a test's, nobody's
FARM = """\
farm: a
link: {kind: veth}
api: %s
drives: [{name: a, model: akd-profinet}]
"""


def config(tmp_path, api, more=""):
    return parse_farm(FARM % api + more, tmp_path / "a.pnfarm.yml")


def mode(path):
    return stat.S_IMODE(path.stat().st_mode)


def test_on_loopback_no_token_is_asked_for(tmp_path):
    found = token_of(config(tmp_path, "127.0.0.1:8702", "state: ./state\n"))
    assert (found.value, found.file) == (None, None)
    assert not (tmp_path / "state").exists()


def test_a_token_of_the_farm_file_is_written_to_no_other(tmp_path):
    for listen in ("127.0.0.1:1", "0.0.0.0:1"):
        found = token_of(config(tmp_path, f"{{listen: '{listen}', token: {GIVEN}}}", "state: ./state\n"))
        assert (found.value, found.file, found.in_log) == (GIVEN, None, None)


def test_beyond_loopback_it_is_made_at_the_first_start_and_kept_with_the_state(tmp_path):
    first = token_of(config(tmp_path, "0.0.0.0:1", "state: ./state\n"))
    assert first.file == tmp_path / "state" / "api-token"
    assert len(first.value) >= 24
    assert first.file.read_text() == f"{first.value}\n"
    assert mode(first.file) == 0o600
    assert first.in_log is None
    assert token_of(config(tmp_path, "0.0.0.0:1", "state: ./state\n")) == first
    assert [path.name for path in first.file.parent.iterdir()] == ["api-token"]


def test_without_a_place_to_keep_it_there_is_a_new_one_for_each_start(tmp_path):
    first, second = (token_of(config(tmp_path, "0.0.0.0:1")) for _ in range(2))
    assert first.file is None
    assert first.in_log == first.value != second.value


def test_a_file_of_ones_own_is_filled_at_the_first_start(tmp_path):
    section = "{listen: '127.0.0.1:1', token_file: keys/api}"
    first = token_of(config(tmp_path, section))
    assert first.file == tmp_path / "keys" / "api"
    assert token_of(config(tmp_path, section)).value == first.value
    first.file.write_text("chosen-by-hand")
    assert token_of(config(tmp_path, section)).value == "chosen-by-hand"


def test_a_given_token_goes_into_the_file_for_those_who_read_it_there(tmp_path):
    section = "{listen: '0.0.0.0:1', token_file: key%s}"
    made = token_of(config(tmp_path, section % ""))
    given = token_of(config(tmp_path, section % f", token: {GIVEN}"))
    assert given.value == GIVEN != made.value
    assert (tmp_path / "key").read_text() == f"{GIVEN}\n"
    assert mode(tmp_path / "key") == 0o600


def test_a_folder_that_hands_its_group_on_lets_that_group_read(tmp_path):
    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o2750)
    found = token_of(config(tmp_path, "{listen: '0.0.0.0:1', token_file: shared/key}"))
    assert mode(found.file) == 0o640


@pytest.mark.parametrize(
    "text", ["", "short", "two words here", "eins-zwei-dr\u00e4i", "x" * 600, "line-one\nline-two"]
)
def test_a_file_that_holds_no_token_is_reported_and_left_as_it_is(tmp_path, text):
    (tmp_path / "key").write_text(text)
    with pytest.raises(EnvironmentError_, match="key holds no token: 8 to 512 visible characters") as caught:
        token_of(config(tmp_path, "{listen: '0.0.0.0:1', token_file: key}"))
    assert "\n" not in str(caught.value)
    assert (tmp_path / "key").read_text() == text


def test_a_place_where_no_file_can_be_is_reported(tmp_path):
    (tmp_path / "in").write_text("")
    with pytest.raises(EnvironmentError_, match=r"the token's file .*in/key: not a directory; set another token_file"):
        token_of(config(tmp_path, "{listen: '0.0.0.0:1', token_file: in/key}"))
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(EnvironmentError_, match=r"the token's file .*pipe: it is a pipe"):
        token_of(config(tmp_path, "{listen: '0.0.0.0:1', token_file: pipe}"))


def test_a_symbolic_link_is_not_followed(tmp_path):
    (tmp_path / "other").write_text("untouched")
    fresh = tmp_path / f".key.{os.getpid()}"
    fresh.symlink_to(tmp_path / "other")
    with pytest.raises(EnvironmentError_, match="the token's file"):
        token_of(config(tmp_path, "{listen: '0.0.0.0:1', token_file: key}"))
    assert (tmp_path / "other").read_text() == "untouched"


@pytest.mark.parametrize("token", ["with blanks in it", "gr\u00fc\u00dfe-an-alle"])
def test_a_token_that_no_header_can_carry_is_refused(tmp_path, token):
    with pytest.raises(FarmFileError, match=r"api\.token: has characters that no header can carry"):
        config(tmp_path, f"{{listen: '0.0.0.0:1', token: '{token}'}}")


def test_a_token_that_reads_asks_every_client_for_one_and_the_other_is_made(tmp_path):
    found = token_of(config(tmp_path, f"{{listen: '127.0.0.1:1', read_token: {GIVEN}}}"))
    assert found.read == GIVEN
    assert found.in_log == found.value
    kept = token_of(config(tmp_path, f"{{listen: '127.0.0.1:1', read_token: {GIVEN}}}", "state: ./state\n"))
    assert kept.file == tmp_path / "state" / "api-token"
    both = token_of(config(tmp_path, f"{{listen: '0.0.0.0:1', token: {GIVEN}-too, read_token: {GIVEN}}}"))
    assert (both.value, both.read) == (f"{GIVEN}-too", GIVEN)


def test_a_token_that_reads_cannot_be_the_one_that_changes(tmp_path):
    with pytest.raises(FarmFileError, match="read_token: is the same as token"):
        config(tmp_path, f"{{listen: '127.0.0.1:1', token: {GIVEN}, read_token: {GIVEN}}}")
    (tmp_path / "secret").write_text(GIVEN)
    section = f"{{listen: '127.0.0.1:1', token_file: secret, read_token: {GIVEN}}}"
    with pytest.raises(EnvironmentError_, match="holds the read_token"):
        token_of(config(tmp_path, section))
