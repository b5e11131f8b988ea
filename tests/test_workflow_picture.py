"""The picture of the workflow shows something of each stage, from the files that the demo makes."""

import json
import shutil

import nrrd
import numpy as np
import pytest
from PIL import Image

from tests.scene.balls import write_balls
from tools.workflow_picture import CELL, DPI, LEFT, STEP, TOPS, draw


@pytest.fixture
def demo(tmp_path):
    """Results of a demo of two balls."""
    root, balls = tmp_path / "demo" / "orbital", write_balls(tmp_path)
    for name in ("compose", "pse", "edits/glass", "edits/gold", "edits/crimson"):
        place = root / "scene" / "demo" / name
        place.mkdir(parents=True)
        for file in (balls, *tmp_path.glob("*.safetensors")):
            shutil.copy(file, place)
    (root / "scene/demo/pse/scene.yaml").rename(root / "scene/demo/pse/pse-2.yaml")
    Image.new("RGB", (8, 8), "red").save(root / "scene/demo/edits/glass/style.png")
    (root / "volume").mkdir()
    values = np.random.default_rng(0).random((6, 5, 4), dtype=np.float32)
    nrrd.write(str(root / "volume/volume.nrrd"), values)
    summary = {"dtype": "float32", "minimum": 0.0, "maximum": 1.0, "histogram": [1, 2, 3]}
    (root / "volume/volume.json").write_text(json.dumps(summary))
    (root / "TF02/views/train").mkdir(parents=True)
    for index in range(9):
        view = np.zeros((64, 64, 4), np.uint8)
        view[20:40, 20:40] = (255, 0, 0, 255)
        Image.fromarray(view).save(root / f"TF02/views/train/{index}.png")
    values = {"psnr": 30.0, "ssim": 0.9, "megabytes": 1.0, "short_rmse": 0.1}
    measured = (
        "TF01/demo/texture",
        "TF02/demo/texture",
        *(f"scene/demo/edit_metrics/{x}" for x in ("glass", "gold")),
    )
    for name in measured:
        (root / name).mkdir(parents=True)
        (root / name / "metrics.json").write_text(json.dumps({"numbers": values}))
    return tmp_path / "demo"


def test_each_stage_has_its_picture(demo):
    picture = np.asarray(draw(demo).convert("RGB")).astype(float)
    for top in TOPS:
        for place in range(6):
            left = LEFT + place * STEP
            rows, columns = (
                slice(round(DPI * (x + 0.1)), round(DPI * (x + CELL - 0.1))) for x in (top, left)
            )
            assert picture[rows, columns].std() > 10, (top, place)
    glass = picture[round(DPI * TOPS[1]) :, round(DPI * (LEFT + 2 * STEP)) :][
        : round(DPI * CELL), : round(DPI * CELL)
    ]
    assert (glass[-25:-10, -25:-10] == (255, 0, 0)).all(), "the style in a corner"
