"""A scene of two small balls, and a browser that draws WebGL2 in software; tests skip where there is none."""

import pytest

from benchmarks.browser import NAMES, SOFTWARE, browser_path
from tests.scene.balls import write_balls

MISSING = "needs Playwright: pip install '.[browser]'"


@pytest.fixture
def scene_file(tmp_path):
    return write_balls(tmp_path)


@pytest.fixture(scope="module")
def chromium():
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="needs Playwright: pip install '.[browser]'"
    )
    path = browser_path()
    if path is None:
        pytest.skip(f"needs a browser on the PATH: {', '.join(NAMES)}")
    with playwright.sync_playwright() as started:
        launched = started.chromium.launch(executable_path=path, args=SOFTWARE)
        try:
            yield launched
        finally:
            launched.close()
