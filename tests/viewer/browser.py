"""A browser without a window that draws WebGL2 in software; tests skip where there is none."""

import shutil
from contextlib import contextmanager

import pytest

MISSING = "needs Playwright: pip install '.[browser]'"
BROWSERS = ("chromium", "chromium-browser", "google-chrome")
SOFTWARE = ("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist")


def chromium_path():
    """The path of a Chromium; skips the test that asks where it or Playwright is missing."""
    pytest.importorskip("playwright.sync_api", reason=MISSING)
    path = next(filter(None, map(shutil.which, BROWSERS)), None)
    if path is None:
        pytest.skip(f"needs a browser on the PATH: {', '.join(BROWSERS)}")
    return path


@contextmanager
def browser(args=SOFTWARE):
    """A Playwright browser, started with these arguments."""
    path = chromium_path()
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        launched = playwright.chromium.launch(executable_path=path, args=args)
        try:
            yield launched
        finally:
            launched.close()
