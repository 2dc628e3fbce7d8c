"""One farm and one browser for all tests of the page."""

import pytest
from browser import Browser
from page_farm import TOOLS, call, running


@pytest.fixture(scope="module")
def farm(tmp_path_factory):
    with running(tmp_path_factory.mktemp("farm")) as url:
        yield url


@pytest.fixture(scope="module")
def window(farm, tmp_path_factory):
    with Browser(tmp_path_factory.mktemp("browser"), 1366, 768) as browser:
        browser.open(f"{farm}/")
        browser.until("document.querySelectorAll('table.drives tbody th').length === 7")
        browser.ask(TOOLS)
        browser.until("all('table.drives td', 'S4 operation').length === 7")
        yield browser


@pytest.fixture
def page(window, farm):
    """The page as it is after the last test, with no fault in force; it must have no error."""
    window.resize(1366, 768)
    window.scheme("light")
    call(farm, "POST", "reset")
    yield window
    assert window.problems == []
