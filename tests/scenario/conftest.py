"""One browser that all tests of pages share."""

from collections.abc import Iterator

import pytest

from browser import Tab


@pytest.fixture(scope="session")
def _browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with Tab(tmp_path_factory.mktemp("browser")) as opened:
        yield opened


@pytest.fixture
def tab(_browser: Tab) -> Tab:
    """Its tab, empty, of the usual size, and with no memory of what was before."""
    _browser.clear()
    _browser.call("Emulation.setEmulatedMedia", features=[])
    return _browser
