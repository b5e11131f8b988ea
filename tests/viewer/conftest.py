"""A scene of two small balls, and a browser that draws WebGL2 in software; tests skip where there is none."""

import pytest

from benchmarks.browser import NAMES, SOFTWARE, browser_path
from tests.edit.lift_scenes import write_two_balls
from tests.fields.surfels.test_composition import ball
from tests.scene.balls import write_balls
from tests.scene.test_twin import HIGH, LOW, sphere_volume
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene

MISSING = "needs Playwright: pip install '.[browser]'"


@pytest.fixture
def scene_file(tmp_path):
    return write_balls(tmp_path)


@pytest.fixture
def balls_file(tmp_path):
    return write_two_balls(tmp_path)


@pytest.fixture
def sphere_file(tmp_path):
    """Two balls that claim to be a sphere."""
    files = {name: write_model(tmp_path / f"{name}.safetensors", ball(1)) for name in ("low", "high")}
    models = {name: SceneModel(file) for name, file in files.items()}
    volume = sphere_volume(tmp_path, low=LOW, high=HIGH)
    return write_scene(tmp_path / "scene.yaml", Scene(models, volume=volume))


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
