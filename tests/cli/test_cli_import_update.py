"""``pnfarm import --update`` and ``--dry-run``: a second import into a farm file that its user has edited."""

import shutil
import zipfile

import pytest
from aml_project import ISLAND, drive, module, plc, project, station, tag
from cell_file import GSDML

from pnfarm.farm.file.reading import load_farm

DI16, DO8 = (f"GSD:{ISLAND}/M/{name}" for name in ("DI16", "DO8"))
INPUTS, OUTPUTS = ("Input", 20, 16), ("Output", 5, 8)
TAGS = [tag("part", "%I20.3"), tag("lamp", "%Q5.1")]


def island(name="island-1", ip="10.7.0.41", *modules):
    plugged = modules or (module(1, DI16, INPUTS), module(2, DO8, OUTPUTS))
    return station(name, ip, f"GSD:{ISLAND}/DAP/DAP 1", *plugged, kind=f"GSD:{ISLAND}/D")


FIRST = plc(tags=TAGS), drive("axis-1", "10.7.0.11"), drive("axis-2", "10.7.0.12"), island()


@pytest.fixture
def cell(pnfarm, tmp_path):
    """Imports a project of these parts; the result, and the farm file."""
    shutil.copy(GSDML, tmp_path)
    out = tmp_path / "cell.pnfarm.yml"

    def run(*parts, options=()):
        (tmp_path / "p.aml").write_text(project(*(parts or FIRST)), encoding="utf-8")
        return pnfarm("import", tmp_path / "p.aml", "-o", out, *options), out

    return run


def files(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "p.aml"}


def test_a_second_import_of_the_same_project_changes_nothing(cell):
    _, out = cell()
    before = files(out.parent)
    for option in ("--update", "--dry-run"):
        found, _ = cell(options=(option,))
        assert (found.code, found.err, found.out) == (0, "", f"{out}: nothing to change\n")
        assert files(out.parent) == before


def test_edits_stay_and_the_project_s_changes_come(cell):
    _, out = cell()
    text = out.read_text().replace("kind: macvlan, parent: eth1", "kind: memory")
    text = text.replace("axis-1\n", "axis-1   # the fast one\n    impair: [{kind: silence, after: 5s}]\n")
    out.write_text(text + "state: ./state\n")
    changed = plc(tags=TAGS[:1]), drive("axis-1", "10.7.0.21"), drive("axis-3", "10.7.0.13"), island("valve")
    found, _ = cell(*changed, options=("--update",))
    assert (found.code, found.err) == (0, "")
    assert found.out.splitlines() == [
        "axis-1: changed: ip",
        "axis-2: gone from the project: removed, as you had changed nothing in it",
        "axis-3: added",
        "island-1: changed: name, signals; its name is valve now",
        f"{out}: updated",
    ]
    text = out.read_text()
    for kept in (
        "{kind: memory}",
        "axis-1   # the fast one\n    impair: [{kind: silence, after: 5s}]\n",
        "state: ./st",
    ):
        assert kept in text
    config = load_farm(out)
    assert [(one.name, str(one.ip)) for one in (*config.drives, *config.devices)] == [
        ("axis-1", "10.7.0.21/24"), ("axis-3", "10.7.0.13/24"), ("valve", "10.7.0.41/24"),
    ]  # fmt: skip
    assert list(config.devices[0].signals) == ["part"]
    again, _ = cell(*changed, options=("--update",))
    assert again.out == f"{out}: nothing to change\n"


@pytest.mark.parametrize("names", [("cell.pnfarm.yml", "cell.imported.yml"), ("cell.imported.yml",)])
def test_files_that_a_version_control_stored_with_other_ends_of_lines_are_those_of_the_import(cell, names):
    _, out = cell()
    for name in names:
        path = out.with_name(name)
        path.write_bytes(path.read_bytes().replace(b"\n", b"\r\n"))
    same, _ = cell(options=("--update",))
    assert (same.code, same.out) == (0, f"{out}: nothing to change\n")
    without = plc(tags=TAGS), drive("axis-1", "10.7.0.21"), island()
    found, _ = cell(*without, options=("--update",))
    assert (found.code, found.out.splitlines()) == (0, [
        "axis-1: changed: ip",
        "axis-2: gone from the project: removed, as you had changed nothing in it",
        f"{out}: updated",
    ])  # fmt: skip
    octets = out.read_bytes()
    assert octets.count(b"\r") == (octets.count(b"\n") if out.name in names else 0)


def test_a_dry_run_shows_the_difference_and_writes_nothing(cell):
    first, out = cell(options=("--dry-run",))
    assert (first.code, files(out.parent).keys()) == (0, {GSDML.name})
    assert "--- /dev/null\n" in first.out
    assert "+  - name: axis-1\n" in first.out
    assert "axis-1: added\n" in first.out
    cell()
    before = files(out.parent)
    found, _ = cell(plc(tags=TAGS), *FIRST[1:2], drive("axis-2", "10.7.0.22"), island(), options=("--dry-run",))
    assert files(out.parent) == before
    assert "-    ip: 10.7.0.12/24\n+    ip: 10.7.0.22/24\n" in found.out
    assert found.out.endswith("axis-2: changed: ip\n")


def test_without_update_a_farm_file_that_is_there_is_left(cell):
    _, out = cell()
    out.write_text(text := out.read_text() + "# mine\n")
    found, _ = cell()
    assert (found.code, out.read_text()) == (2, text)
    assert "--update" in found.err
    found, _ = cell(options=("--force",))
    assert (found.code, "# mine" in out.read_text()) == (0, False)


def test_options_that_contradict_each_other_or_need_a_file_are_refused(cell, pnfarm):
    found, out = cell(options=("--force", "--update"))
    assert (found.code, out.exists(), "--force replaces" in found.err) == (2, False, True)
    for option in ("--update", "--dry-run"):
        found = pnfarm("import", out.parent / "p.aml", option)
        assert (found.code, "needs -o FARM" in found.err) == (2, True)


def test_without_the_record_of_the_last_import_keys_decide_and_that_is_said(cell):
    _, out = cell()
    (out.parent / "cell.imported.yml").unlink()
    out.write_text(out.read_text().replace("10.7.0.12/24", "10.7.0.99/24\n    limits: lax"))
    found, _ = cell(options=("--update",))
    assert "cell.imported.yml is not there: keys that an import writes are taken for the project's" in found.out
    assert "    ip: 10.7.0.12/24\n    limits: lax\n" in out.read_text()
    assert (out.parent / "cell.imported.yml").exists()


@pytest.mark.parametrize(
    "octets", [b"", b"\xff\n\n\n", b"a\nb\nc", b"#\ndescription_files: 3\nfarm: x\n", b"#\n{\nfarm: x"]
)
def test_a_damaged_record_is_refused(cell, octets):
    _, out = cell()
    (out.parent / "cell.imported.yml").write_bytes(octets)
    before = files(out.parent)
    found, _ = cell(drive("axis-1", "10.7.0.21"), options=("--update",))
    assert (found.code, "cell.imported.yml is not what an import wrote" in found.err) == (2, True)
    assert files(out.parent) == before


@pytest.mark.parametrize(
    ("edit", "words"),
    [(("model: hiwin-e1", "model: no-such"), "cell.pnfarm.yml:13: drives[0].model:"),
     (("farm: p", "farm: {"), "cell.pnfarm.yml:"),
     (("farm: p", "- farm"), "cell.pnfarm.yml:"),
     (("farm: p", "farm: \0"), "NUL")],
)  # fmt: skip
def test_a_farm_file_with_errors_is_refused_by_its_own_lines(cell, edit, words):
    _, out = cell()
    out.write_text(out.read_text().replace(*edit))
    before = files(out.parent)
    found, _ = cell(drive("axis-1", "10.7.0.21"), options=("--update",))
    assert (found.code, words in found.err) == (2, True)
    assert files(out.parent) == before


def test_changes_that_the_farm_file_could_not_be_read_with_are_shown_and_not_written(cell):
    _, out = cell()
    out.write_text(out.read_text().replace("10.7.0.12/24", "10.7.0.21/24"))
    before = files(out.parent)
    for options in (("--dry-run",), ("--update",)):
        found, _ = cell(FIRST[0], drive("axis-1", "10.7.0.21"), *FIRST[2:], options=options)
        assert found.code == 2
        assert "could not be read with these changes, and is as it was" in found.err
        assert "10.7.0.21" in found.err
        assert files(out.parent) == before


def test_a_failure_while_writing_leaves_the_old_file(cell, monkeypatch):
    _, out = cell()
    before = files(out.parent)

    def fail(self, target):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("pathlib.Path.replace", fail)
    found, _ = cell(drive("axis-1", "10.7.0.21"), options=("--update",))
    assert (found.code, "cannot be written: no space left on device" in found.err) == (2, True)
    assert files(out.parent) == before


def test_permissions_and_links_stay(cell, tmp_path_factory):
    _, out = cell()
    out.chmod(0o640)
    elsewhere = tmp_path_factory.mktemp("elsewhere") / "cell.pnfarm.yml"
    elsewhere.symlink_to(out)
    found, _ = cell(*FIRST[:2], drive("axis-2", "10.7.0.22"), island(), options=("--update",))
    assert found.code == 0
    assert out.stat().st_mode & 0o777 == 0o640
    assert elsewhere.is_symlink()


def test_a_file_of_a_windows_editor_stays_one(cell):
    _, out = cell()
    text = out.read_text().replace("axis-1\n", "axis-1\n    limits: lax\n").replace("\n", "\r\n")
    out.write_bytes(b"\xef\xbb\xbf" + text.encode())
    found, _ = cell(*FIRST[:2], drive("axis-2", "10.7.0.22"), island(), options=("--update",))
    assert found.code == 0
    assert out.read_bytes() == b"\xef\xbb\xbf" + text.replace("10.7.0.12", "10.7.0.22").encode()


def archive(folder, octets):
    with zipfile.ZipFile(folder / "maker.zip", "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr(ISLAND, octets)


def test_a_description_file_is_replaced_only_if_it_is_as_the_import_wrote_it(cell, tmp_path, tmp_path_factory):
    library = tmp_path_factory.mktemp("library")
    archive(library, GSDML.read_bytes())
    first, _ = cell(options=("--gsdml", library))
    (tmp_path / GSDML.name).unlink()
    assert first.code == 0
    own = tmp_path / ISLAND
    newer = GSDML.read_bytes() + b"<!-- newer -->\n"
    archive(library, newer)
    found, out = cell(options=("--gsdml", library, "--update"))
    assert (found.code, f"{ISLAND}: replaced\n" in found.out, own.read_bytes()) == (0, True, newer)
    mine = GSDML.read_bytes() + b"<!-- mine -->\n"
    own.write_bytes(mine)
    archive(library, GSDML.read_bytes())
    found, out = cell(options=("--gsdml", library, "--update"))
    assert (found.code, own.read_bytes()) == (0, mine)
    assert f"{ISLAND}: kept, as it is not as an import wrote it" in found.out
    assert load_farm(out).devices[0].gsdml == ISLAND


def test_a_new_description_file_is_read_before_it_is_there(cell, tmp_path, tmp_path_factory):
    _, out = cell(*FIRST[:3])
    out.write_text(out.read_text() + "# mine\n")
    (tmp_path / GSDML.name).unlink()
    library = tmp_path_factory.mktemp("library")
    archive(library, GSDML.read_bytes())
    found, _ = cell(options=("--gsdml", library, "--update"))
    assert (found.code, found.err) == (0, "")
    assert f"{ISLAND}: written\n" in found.out
    assert "island-1: added\n" in found.out
    assert [one.name for one in load_farm(out).devices] == ["island-1"]


def test_a_device_whose_file_is_not_at_hand_the_second_time_is_kept(cell, tmp_path, tmp_path_factory):
    library = tmp_path_factory.mktemp("library")
    shutil.copy(GSDML, library)
    cell(*FIRST[:3])
    (tmp_path / GSDML.name).unlink()
    _, out = cell(options=("--gsdml", library, "--update"))
    out.write_text(text := out.read_text().replace("island-1\n", "island-1\n    limits: lax\n"))
    found, _ = cell(options=("--update",))
    assert "island-1: kept; the project has it, but it cannot be made now: GSDML-V2" in found.out
    found, _ = cell(options=("--gsdml", library, "--update"))
    assert (found.code, out.read_text()) == (0, text)


def test_a_description_file_that_is_lost_is_written_again(cell, tmp_path, tmp_path_factory):
    library = tmp_path_factory.mktemp("library")
    archive(library, GSDML.read_bytes())
    cell(*FIRST[:3])
    (tmp_path / GSDML.name).unlink()
    for _ in range(2):
        found, _ = cell(options=("--gsdml", library, "--update"))
        assert (found.code, (tmp_path / ISLAND).read_bytes()) == (0, GSDML.read_bytes())
        (tmp_path / ISLAND).unlink()


def test_a_description_file_with_an_apostrophe_in_its_name_is_read_before_it_is_there(cell, tmp_path_factory):
    _, out = cell(*FIRST[:3])
    name = "GSDML-V2.35-Maker's-Island-20261127.xml"
    library = tmp_path_factory.mktemp("library")
    with zipfile.ZipFile(library / "maker.zip", "w") as made:
        made.writestr(name, GSDML.read_bytes())
    found, _ = cell(*FIRST[:3], island().replace(ISLAND, name), options=("--gsdml", library, "--update"))
    assert (found.code, found.err) == (0, "")
    assert load_farm(out).devices[0].gsdml == name
