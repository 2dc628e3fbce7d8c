"""The drives' non-volatile memory survives what happens to processes and files."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from pnfarm.drives.parameters.memory import NonVolatile
from pnfarm.errors import EnvironmentError_
from pnfarm.farm.memory.sqlite import FILE_NAME, FarmState

VALUES = {
    "name": "axis-01",
    "ip": {"address": "10.77.0.11", "mask": "255.255.255.0", "gateway": None},
    "parameters": {2135: 1, 2108: 10_000_170},
    "faults": [[702, 0], [139]],
    "im": {"im1": b"plant", "im3": b""},
}


def test_what_is_saved_is_there_after_a_restart(tmp_path):
    with FarmState(tmp_path / "state") as state:
        assert state.load("axis-01") is None
        state.save("axis-01", VALUES)
        state.save("axis-02", {})
    with FarmState(tmp_path / "state") as state:
        assert state.load("axis-01") == VALUES
        assert state.load("axis-02") == {}
        assert state.stations() == ["axis-01", "axis-02"]


def test_a_save_replaces_and_a_delete_forgets(tmp_path):
    with FarmState(tmp_path) as state:
        state.save("axis-01", VALUES)
        state.save("axis-01", {"name": "press"})
        assert state.load("axis-01") == {"name": "press"}
        state.save("axis-02", VALUES)
        state.delete("axis-01")
        assert state.load("axis-01") is None
        assert state.load("axis-02") == VALUES


def test_without_a_folder_it_keeps_everything_in_memory(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    memory: NonVolatile = FarmState(None)
    memory.save("axis-01", VALUES)
    loaded = memory.load("axis-01")
    assert loaded == VALUES
    loaded["name"] = "other"
    assert memory.load("axis-01") == VALUES
    assert list(tmp_path.iterdir()) == []
    memory.close()


_JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(max_size=8),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(
            st.text(max_size=4) | st.integers() | st.sampled_from(["$octets", "$pairs"]), inner, max_size=3
        )
    ),
    max_leaves=10,
)
_SHARED = FarmState(None)


@given(st.dictionaries(st.text(st.characters(codec="utf-8"), min_size=1), _JSON, max_size=4))
def test_every_kind_of_value_comes_back_equal(values):
    _SHARED.save("s", values)
    assert _SHARED.load("s") == values


@pytest.mark.parametrize("values", [{"x": {1.5}}, {"x": object()}, {7: 1}, {"": 1}, {"x": {(1, 2): 3}}])
def test_what_cannot_be_kept_is_refused_and_changes_nothing(values):
    with FarmState(None) as state:
        state.save("axis-01", VALUES)
        with pytest.raises(TypeError):
            state.save("axis-01", values)
        assert state.load("axis-01") == VALUES


def test_several_threads_may_save_at_once(tmp_path):
    with FarmState(tmp_path) as state:

        def work(number):
            for count in range(20):
                state.save(f"axis-{number}", {"count": count})

        threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        assert [state.load(f"axis-{number}") for number in range(4)] == [{"count": 19}] * 4


_WRITER = """
import sys
from pnfarm.farm.memory.sqlite import FarmState
state = FarmState(sys.argv[1])
count = 0
while True:
    state.save("axis-01", {f"key-{i}": count for i in range(50)})
    print(count, flush=True)
    count += 1
"""


def test_a_process_killed_again_and_again_leaves_a_whole_save_each_time(tmp_path):
    root = Path(__file__).resolve().parents[2]
    for saves in (1, 2, 5, 13, 40, 100):
        writer = subprocess.Popen(
            [sys.executable, "-c", _WRITER, str(tmp_path)], stdout=subprocess.PIPE, text=True, cwd=root
        )
        with writer:
            done = [int(writer.stdout.readline()) for _ in range(saves)]
            writer.send_signal(signal.SIGKILL)
            done += [int(line) for line in writer.stdout.read().splitlines() if line]
        with FarmState(tmp_path) as state:
            values = state.load("axis-01")
        assert len(values) == 50
        (count,) = set(values.values())
        assert count in {done[-1], done[-1] + 1}


def damaged(tmp_path, change):
    with FarmState(tmp_path) as state:
        for number in range(50):
            state.save(f"axis-{number}", VALUES)
    file = tmp_path / FILE_NAME
    data = bytearray(file.read_bytes())
    change(data)
    file.write_bytes(data)
    return file, bytes(data)


@pytest.mark.parametrize(
    "change",
    [
        lambda data: data.__setitem__(slice(0, 100), b"\xff" * 100),
        lambda data: data.__setitem__(slice(4096, 8192), bytes(4096)),
        lambda data: data.__delitem__(slice(5000, None)),
        lambda data: data.__setitem__(slice(None), b"not a database, but a text file of somebody\n" * 20),
    ],
    ids=["header", "page", "cut", "text"],
)
def test_a_damaged_file_is_named_and_left_alone(tmp_path, change):
    file, before = damaged(tmp_path, change)
    with pytest.raises(EnvironmentError_, match="damaged") as caught:
        FarmState(tmp_path)
    assert str(file) in str(caught.value)
    assert "move it away" in str(caught.value)
    assert caught.value.exit_code == 4
    assert file.read_bytes() == before


def test_a_damaged_value_names_its_station(tmp_path):
    with FarmState(tmp_path) as state:
        state.save("axis-01", VALUES)
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.execute("UPDATE memory SET value = '{' WHERE key = 'name'")
    connection.close()
    with FarmState(tmp_path) as state, pytest.raises(EnvironmentError_, match="'name' of station 'axis-01'"):
        state.load("axis-01")


def test_another_programs_database_is_refused(tmp_path):
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.execute("CREATE TABLE memory (x)")
    connection.close()
    with pytest.raises(EnvironmentError_, match="another program"):
        FarmState(tmp_path)


def test_a_newer_format_is_refused(tmp_path):
    FarmState(tmp_path).close()
    with sqlite3.connect(tmp_path / FILE_NAME) as connection:
        connection.execute("PRAGMA user_version = 99")
    connection.close()
    with pytest.raises(EnvironmentError_, match="newer pnfarm"):
        FarmState(tmp_path)


def test_a_folder_that_cannot_be_made_is_the_machines_fault(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(EnvironmentError_, match="cannot open the state folder"):
        FarmState(tmp_path / "file" / "state")
    (tmp_path / FILE_NAME).mkdir()
    with pytest.raises(EnvironmentError_, match="cannot open the drives' memory"):
        FarmState(tmp_path)


def test_a_locked_file_says_so(tmp_path, monkeypatch):
    monkeypatch.setattr("pnfarm.farm.memory.sqlite._BUSY_SECONDS", 0.05)
    with FarmState(tmp_path) as state:
        other = sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(EnvironmentError_, match="no other farm uses it"):
            state.save("axis-01", VALUES)
        other.execute("ROLLBACK")
        other.close()
        state.save("axis-01", VALUES)
        assert state.load("axis-01") == VALUES


def test_what_could_not_be_written_is_read_and_written_with_the_next_save_or_at_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr("pnfarm.farm.memory.sqlite._BUSY_SECONDS", 0.05)

    def refused(state, station):
        other = sqlite3.connect(tmp_path / FILE_NAME, isolation_level=None)
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(EnvironmentError_):
            state.save(station, VALUES)
        state.hold(station, VALUES)
        other.execute("ROLLBACK")
        other.close()

    with FarmState(tmp_path) as state:
        state.save("axis-01", {})
        refused(state, "axis-01")
        assert state.load("axis-01") == VALUES
        state.save("axis-02", {})
        with FarmState(tmp_path) as later:
            assert later.load("axis-01") == VALUES
        refused(state, "axis-02")
        state.save("axis-02", {"newer": 1})
        assert state.load("axis-02") == {"newer": 1}
        refused(state, "axis-03")
    with FarmState(tmp_path) as later:
        assert (later.load("axis-02"), later.load("axis-03")) == ({"newer": 1}, VALUES)


def test_a_closed_memory_refuses(tmp_path):
    state = FarmState(tmp_path)
    state.close()
    with pytest.raises(EnvironmentError_, match="closed"):
        state.load("axis-01")
    with pytest.raises(EnvironmentError_, match="closed"):
        state.save("axis-01", {})
