"""The view of a device: its modules, its signals as switches, lamps and fields, forces, faults, traces."""

import pytest
from browser import PROGRAM
from page_farm import call, show

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="chromium is not installed (apt-get install chromium)")


def values(farm, device="island"):
    return {one["name"]: one["value"] for one in call(farm, "GET", f"devices/{device}/signals")["signals"]}


def signals_of(farm, device="island"):
    return call(farm, "GET", f"devices/{device}/signals")["signals"]


def submit(page, label):
    page.ask(f"labelled('{label}').form.requestSubmit()")


@pytest.fixture
def device(page, farm):
    """The page with the island, whose inputs are zero; what it refuses is not an error of the page."""
    call(farm, "PATCH", "devices/island/signals?as=force", {"*": None})
    call(farm, "PATCH", "devices/island/signals", {"slot1_input_0": False, "part_present": False, "pressure": 0})
    show(page, "#/device/island")
    page.until("all('button[role=switch]').length === 21")
    page.until("text('.bar').includes('DATA with plc')")
    page.until("labelled('pressure').value === '0' && all('.bit.on').length === 0")
    yield page
    page.problems[:] = [one for one in page.problems if "412" not in one and "422" not in one]


def test_devices_are_listed_beside_the_drives_and_found_by_the_filter(page):
    show(page, "#/")
    page.until("all('table.devices tbody th').length === 2 && all('table.devices .state', 'connected').length === 2")
    (row,) = page.ask("all('table.devices tbody tr').filter(one => one.textContent.startsWith('island')).map("
                      "one => [...one.cells].map(cell => cell.textContent))")  # fmt: skip
    assert row == ["island", "Island head", "connected", "plc", "16 ms", "DATA", "10.0.0.81", "27", "9", ""]
    page.until("type('Filter by name, address or controller', 'code reader')")
    page.until("all('table.devices tbody th').length === 1 && text('main').includes('1 of 2 devices')")
    page.ask("type('Filter by name, address or controller', '')")
    page.until("press('table.devices a', 'island') && location.hash === '#/device/island'")


def test_a_device_shows_who_it_is_what_is_plugged_where_and_what_was_agreed(device, farm):
    facts = device.ask("text('main dl')")
    for word in ("Example Works", "EX-ISL-100", "0xFEED", "DAP 1", "10.0.0.81/24"):
        assert word in facts
    assert device.ask("all('details.module summary strong').map(one => one.textContent)") == [
        "Slot 0 · Island head", "Slot 1 · 16DI", "Slot 2 · 8DO", "Slot 3 · 4AI", "Slot 4 · 4FDI",
    ]  # fmt: skip
    (agreed,) = call(farm, "GET", "devices/island")["details"]["connections"]
    shown = "all('details.panel')[0].textContent"
    device.until(f"{shown}.includes('What was agreed') && {shown}.includes('sent by the device')")
    assert agreed["ar_uuid"] in device.ask(shown)
    assert "ident 0x0060 · 5 inputs, 1 output PROFIsafe" in device.ask("all('details.module summary')[4].textContent")
    assert "does not run the safety protocol" in device.ask("all('details.module')[4].textContent")
    assert "ident 0x0021 · 1 octet out" in device.ask("all('details.module')[2].textContent")
    assert device.ask("all('details.module')[2].querySelectorAll('.bit:not(button)').length") == 8


def test_a_switch_writes_its_bit_and_follows_what_others_write(device, farm):
    bit = "all('button[role=switch]').find(one => one.textContent.includes('%s'))"
    on = f"{bit}.getAttribute('aria-checked') === 'true'"
    device.ask(f"{bit % 'part_present'}.click()")
    # the same bit has a name of the maker's file as well
    device.until(f"{on % 'part_present'} && {on % 'slot1_input_3'}")
    assert values(farm)["part_present"] is True
    call(farm, "PATCH", "devices/island/signals", {"slot1_input_0": True, "part_present": False})
    device.until(f"{on % 'slot1_input_0'} && !({on % 'part_present'})")


def test_a_value_is_typed_in_its_unit_and_a_refused_one_says_why_beside_it(device, farm):
    device.until("type('pressure', 'much')")
    device.until("all('table.values button', 'Write').length === 1")
    submit(device, "pressure")
    device.until("labelled('pressure').getAttribute('aria-invalid') === 'true'")
    why = device.ask("document.getElementById(labelled('pressure').getAttribute('aria-describedby')).textContent")
    assert "pressure: 'much' is not a number" in why
    assert values(farm)["pressure"] == 0
    device.ask("type('pressure', '6.5')")
    submit(device, "pressure")
    device.until("all('[role=alert]').length === 0 && labelled('pressure').value === '6.5'")
    assert values(farm)["pressure"] == 6.5
    assert "bar" in device.ask("labelled('pressure').closest('tr').textContent")
    device.ask("type('pressure', '7')")
    device.ask("labelled('pressure').focus()")
    device.key("Escape")
    device.until("labelled('pressure').value === '6.5' && all('table.values button', 'Write').length === 0")
    device.until("type('slot4_safety_trailer_in', '01 ff')")
    submit(device, "slot4_safety_trailer_in")
    device.until("labelled('slot4_safety_trailer_in').value === '01 ff 00 00'")


def test_what_another_wrote_meanwhile_is_not_overwritten(device, farm):
    device.ask("import('/page/lib/live.js').then(live => { globalThis.farmNow = () => live.farm; })")
    # the first letter of what is typed has seen 0
    device.until("type('pressure', '2')")
    call(farm, "PATCH", "devices/island/signals", {"slot1_input_0": True})
    device.until("all('.bit.on').some(one => one.textContent.includes('slot1_input_0'))")
    submit(device, "pressure")
    device.until("labelled('pressure').value === '2' && all('table.values button', 'Write').length === 0")
    assert values(farm)["pressure"] == 2
    device.until("type('pressure', '3')")
    call(farm, "PATCH", "devices/island/signals", {"pressure": 9})
    submit(device, "pressure")
    device.until("text('[role=alert]') === 'pressure is 9 meanwhile; nothing was written'")
    assert values(farm)["pressure"] == 9
    # who has read that may write over it
    device.until("farmNow().values.get('island').states.get('pressure').shown === '9'")
    submit(device, "pressure")
    device.until("labelled('pressure').value === '3' && all('table.values button', 'Write').length === 0")
    assert values(farm)["pressure"] == 3


def test_outputs_are_bad_while_the_controller_is_away(device):
    bad = "all('details.module')[2].querySelectorAll('.bit .bad').length"
    device.until(f"{bad} === 0")
    device.ask("press('button', 'timeout')")
    device.until(f"{bad} === 8")
    device.until(f"{bad} === 0 && text('.bar').includes('DATA with plc')")
    # its own events are there
    assert "ar established" in device.ask("text('[aria-label=Events]')")


def test_a_fault_on_a_signal_is_made_marked_and_cleared(device, farm):
    device.ask("press('a', 'signal fault…')")
    device.until("text('form.panel h3') === 'signal-stuck' && labelled('on').value === 'island'")
    device.until("[...document.getElementById('words-signal').options].some(one => one.value === 'part_present')")
    device.ask("type('signal', 'part_present')")
    device.ask("type('value', 'true')")
    device.until("text('form.panel').includes('Would hit 1 station: island')")
    device.until("press('button', 'Inject signal-stuck')")
    device.until("press('main table a', 'island')")
    device.until("all('.bit.on').some(one => /part_present.*signal-stuck/.test(one.textContent))")
    assert "signal-stuck on part_present" in device.ask("text('.bar')")
    device.ask("all('button[role=switch]').find(one => one.textContent.includes('part_present')).click()")
    device.until("text('li [role=alert]') === 'waits: a fault has the signal'")
    call(farm, "PATCH", "devices/island/signals?as=force", {"pressure": 4})
    device.until("labelled('pressure').closest('tr').textContent.includes('forced')")
    call(farm, "PATCH", "devices/island/signals?as=force", {"pressure": None})
    (fault,) = call(farm, "GET", "faults")["faults"]
    show(device, "#/")
    device.until("text('table.devices').includes('signal-stuck')")
    show(device, "#/device/island")
    device.until(f"press('button', 'Clear signal-stuck, {fault['id']}')")
    device.until("!text('main').includes('signal-stuck on') && all('.bit.on').length === 0")
    assert call(farm, "GET", "faults")["faults"] == []


def test_a_bit_is_forced_by_the_keyboard_flipped_and_released(device, farm):
    device.ask("labelled('Force part_present').focus()")
    device.key("Enter")
    device.until("all('.bit').some(one => /part_present.*forced/.test(one.textContent))")
    assert [one for one in signals_of(farm) if one["forced"] is not None] == [
        one for one in signals_of(farm) if one["name"] == "part_present" and one["forced"] is False
    ]
    # what is written waits
    device.ask("all('button[role=switch]').find(one => one.textContent.includes('part_present')).click()")
    device.until("text('li [role=alert]') === 'waits: a force has the signal'")
    device.until("press('button', 'Force 1 part_present')")
    device.until("all('.bit.on').some(one => /part_present.*forced/.test(one.textContent))")
    assert values(farm)["part_present"] is True
    device.until("press('button', 'Force 0 part_present')")
    device.until("!all('.bit.on').length")
    device.ask("labelled('Release part_present').focus()")
    device.key("Enter")
    # the switch was on beneath
    device.until("all('.bit.on').length === 2 && !text('.bit').includes('forced') && !labelled('Release part_present')")


def test_a_value_is_forced_as_it_is_or_as_it_is_typed_and_all_are_released_together(device, farm):
    forced = "labelled('pressure').closest('tr').textContent.includes('forced')"
    device.until("press('button', 'Force pressure')")
    device.until(forced)
    device.until("type('pressure', 'much')")
    device.until("press('button', 'Force pressure')")
    device.until("labelled('pressure').getAttribute('aria-invalid') === 'true'")
    device.until("type('pressure', '4.5')")
    device.until("press('button', 'Force pressure')")
    device.until("labelled('pressure').value === '4.5' && all('table.values button', 'Write').length === 0")
    assert values(farm)["pressure"] == 4.5
    device.until("press('button', 'Force slot1_input_0')")
    device.until("press('button', 'release 2 forces')")
    device.until(f"!{forced} && labelled('pressure').value === '0' && !text('.bar').includes('forces')")
    assert all(one["forced"] is None for one in signals_of(farm))


def test_signals_of_a_device_are_traced_on_a_trigger(device, farm):
    show(device, "#/device/island/trace")
    device.until("all('.checks input:checked').length === 6")
    device.until("press('.checks input', undefined) && type('Trigger', 'pressure > 6.5 bar')")
    device.until("type('a sample every', '1ms') && type('after it', '200ms') && type('before it', '50ms')")
    device.ask("all('.checks label', 'pressure')[0].control.checked || press('.checks label', 'pressure')")
    device.until("press('button', 'Start')")
    device.until("text('form').includes('waiting')")
    call(farm, "PATCH", "devices/island/signals", {"pressure": 7})
    device.until("text('form').includes('complete') && text('form').includes('triggered by island')")
    device.until("all('.plot .uplot').length >= 2")
    show(device, "#/device/scanner/trace")
    device.until("type('Find a signal', 'octet_63_')")
    device.until(
        "all('.checks label').some(one => one.textContent.includes('octet_63_7')) && text('form').includes('8 signals')"
    )


def test_a_thousand_signals_are_there_when_they_are_asked_for(page, farm):
    show(page, "#/device/scanner")
    drawn = "all('.bit, table.values tbody tr').length"
    # the large module is closed at first
    page.until("text('main').includes('1032 inputs, 2 outputs')")
    assert page.ask(drawn) == 7
    page.until("type('Find a signal by name, unit or place', 'bit_63_')")
    page.until(f"{drawn} === 8 && text('main').includes('8 of 1034 signals')")
    page.until("type('Find a signal by name, unit or place', '')")
    page.until("press('button', 'Open all')")
    page.until(f"{drawn} === 1034")
    call(farm, "PATCH", "devices/scanner/signals", {"octet_63_0": 255})
    page.until("all('.bit.on').length === 8 && labelled('octet_63_7').value === '255'")
    page.until("press('button', 'Close all')")
    page.until(f"{drawn} === 0")
