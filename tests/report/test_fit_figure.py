import math

import numpy as np
import pytest
import torch
from matplotlib import colormaps
from matplotlib.figure import Figure
from matplotlib.text import Text
from PIL import Image

from tests.fitting.scenes import HEADLIGHT, ball_planes, ball_seeds, cameras
from texgs.core.figures import Scale
from texgs.core.image import write_png
from texgs.fields.splats import GEOMETRY
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.shading import material
from texgs.raster.shading import MATERIAL
from texgs.report import fit_figure
from texgs.report.fit_figure import (
    compare,
    frame,
    lines,
    map_cell,
    maps,
    signed_error,
    write_comparison,
    write_fit_figure,
)
from texgs.scene import frame as of_scene
from texgs.scene.scene import Scene, SceneModel
from texgs.volume.view_set import View


def shading(kind="shared"):
    """A model of the ball with one material, or with one per surfel."""
    parameters = ball_seeds(opacity=0.9)
    if kind == "surfel":
        spread = torch.linspace(-1, 1, len(parameters["means"]))
        parameters |= {name: parameters[name] + spread for name in MATERIAL}
    return Surfels(parameters)


def texture(kind="shared"):
    """The same with one texel per surfel."""
    parameters = dict(shading(kind).parameters)
    n = len(parameters["means"])
    parameters |= {"palette": torch.zeros(3), "texels": torch.zeros(n, 3)}
    parameters |= {"sizes": torch.ones(n, 2, dtype=torch.int32), "offsets": torch.arange(n)}
    return Surfels(parameters)


def surfels():
    parameters = {name: x for name, x in shading().parameters.items() if name in GEOMETRY}
    return Surfels({**parameters, "sh": torch.zeros(len(parameters["means"]), 1, 3)})


MODELS = {"surfels": surfels(), "shading": shading(), "texture": texture()}
RECIPES = {name: Surfels(ball_seeds(seed=seed, opacity=0.9)) for seed, name in enumerate("abcdef")}


@pytest.fixture
def views(tmp_path):
    """The ball from two cameras, cast by rays."""
    named = {}
    for index, camera in enumerate(cameras(2)):
        planes = ball_planes(camera)
        color = planes[:3] - 1 + planes[3]
        path = write_png(tmp_path / f"{index}.png", color.permute(1, 2, 0), planes[3])
        named[f"test view {index}"] = View(camera, path, HEADLIGHT)
    return named


@pytest.fixture
def view(views):
    return views["test view 0"]


@pytest.fixture
def drawn(monkeypatch):
    """The rows that are drawn, instead of a picture."""
    rows = []
    monkeypatch.setattr(fit_figure, "draw", lambda _path, given, _title: rows.extend(given))
    return rows


def test_the_same_models_give_the_same_bytes_2000_pixels_wide(tmp_path, view):
    views = {"test view 0": view, "test view 2": view}
    paths = [write_fit_figure(tmp_path / name, MODELS, views, title="ball") for name in ("a.png", "b.png")]
    assert paths[0].read_bytes() == paths[1].read_bytes()
    with Image.open(paths[0]) as picture:
        assert picture.width == 2000
        pixels = np.asarray(picture.convert("RGB"))
    assert (pixels[[0, -1]] == 255).all()
    assert (pixels[:, [0, -1]] == 255).all()


def phases(kind):
    """The phases of a fit whose first one only seeds."""
    return {"shading": shading(kind), "texture": texture(kind)}


@pytest.mark.parametrize(
    ("write", "models", "padding"),
    [
        (write_fit_figure, phases("shared"), 5),
        (write_fit_figure, phases("surfel"), 5),
        (write_comparison, {f"plenoxels_quick{name}": RECIPES[name] for name in "abcd"}, 0),
    ],
)
def test_words_do_not_overlap(tmp_path, monkeypatch, view, write, models, padding):
    drawn = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, _file, **_options: drawn.append(figure))
    write(tmp_path / "a.png", models, {"training view 100": view, "b": view}, title="ball, TF01")
    (figure,) = drawn
    figure.draw_without_rendering()
    words = [text for text in figure.findobj(Text) if text.get_text() and text.get_visible()]
    boxes = [text.get_window_extent().padded(padding) for text in words]
    for index, box in enumerate(boxes):
        corners = [(box.x0, box.y0), (box.x1, box.y1)]
        assert all(figure.bbox.contains(*corner) for corner in corners), words[index]
        for other in range(index):
            assert not box.overlaps(boxes[other]), (words[index], words[other])
        inside = [axes for axes in figure.axes if axes.images and axes.bbox.overlaps(box)]
        assert not inside or padding == 0, f"{words[index]} lies on a picture"


def test_phases_stand_beside_the_view(view):
    panels, visible = compare(MODELS, view, 1)
    titles = ["ground truth", "surfels", "shading", "texture", "error (red: too bright)"]
    assert [panel.title for panel in panels] == titles
    truth = ball_planes(view.camera)
    torch.testing.assert_close(panels[0].pixels, truth[:3].permute(1, 2, 0), atol=1 / 255, rtol=0)
    shown = MODELS["shading"].render(view.camera)
    assert torch.equal(panels[2].pixels, shown.color.clamp(0, 1))
    error = ((panels[2].pixels - panels[0].pixels) ** 2).mean().item()
    assert panels[2].words == f"PSNR {-10 * math.log10(error):.2f} dB"
    assert visible[(truth[3] > 0.5) | (shown.alpha > 0.5)].all()
    halved, visible = compare(MODELS, view, 2)
    assert visible.shape == halved[1].pixels.shape[:2] == (16, 16)


def test_the_error_is_that_of_the_worst_channel():
    image = torch.tensor([[[0.5, 0.2, 0.9], [0.1, 0.4, 0.6]]])
    target = torch.tensor([[[0.4, 0.5, 0.7], [0.1, 0.3, 0.6]]])
    torch.testing.assert_close(signed_error(image, target), torch.tensor([[-0.3, 0.1]]))


def test_a_perfect_fit_has_no_error(tmp_path):
    (camera,) = cameras(1)
    shown = MODELS["texture"].render(camera)
    color = shown.color - 1 + shown.alpha[..., None]
    view = View(camera, write_png(tmp_path / "view.png", color, shown.alpha), HEADLIGHT)
    panels, _ = compare(MODELS, view, 1)
    assert float(panels[3].words.split()[1]) > 50
    white = torch.tensor(colormaps["bwr"](0.5)[:3])
    assert (panels[4].pixels - white).abs().max() < 0.05


def test_maps_of_one_material_are_numbers(view):
    panels = maps(texture(), view, 1)
    titles = ["normals", "depth, world units", "alpha", "material of all surfels"]
    assert [panel.title for panel in panels] == titles
    numbers = {line.split()[0]: float(line.split()[1]) for line in panels[3].words.splitlines()}
    factors = {"ambient": 0.5, "diffuse": 0.5, "specular": 0.1, "shininess": 20}
    assert numbers == pytest.approx(factors, abs=1e-3)
    assert panels[1].scale.low == pytest.approx(1.5 - 0.3 * math.sqrt(3), abs=0.15), "seeds fill a cube"
    assert torch.equal(panels[0].pixels[0, 0], torch.ones(3)), "the corner is empty"
    middle = panels[0].pixels[10:22, 10:22].mean(dim=(0, 1))
    to_camera = view.camera.position / view.camera.position.norm()
    assert ((2 * middle - 1) @ to_camera) > 0.3, "normals face the camera"


def test_alpha_has_the_colours_of_the_viewer(view, tmp_path):
    """White where opaque; levels of 8 bits apart at most."""
    model = texture()
    write_model(tmp_path / "ball.safetensors", model)
    scene = Scene({"ball": SceneModel(tmp_path / "ball.safetensors")})
    in_viewer = of_scene.frame(scene.open(), view.camera, scene, mode="alpha")
    in_report = next(panel for panel in maps(model, view, 1) if panel.title == "alpha")
    torch.testing.assert_close(255 * in_report.pixels, torch.from_numpy(in_viewer).float(), atol=2, rtol=0)


def test_maps_of_a_material_per_surfel_are_means(view):
    model = texture("surfel")
    panels = maps(model, view, 1)
    assert [panel.title for panel in panels[3:]] == ["ambient", "diffuse", "specular", "shininess"]
    for panel, factor in zip(panels[3:], material(model.parameters, "bounded").values(), strict=True):
        assert factor.min() <= panel.scale.low < panel.scale.high <= factor.max() * (1 + 1e-5)


def test_values_are_colours_over_white():
    values, alpha = torch.tensor([[1.0, 3.0, 0.0]]), torch.tensor([[1.0, 0.5, 0.0]])
    panel = map_cell("", values, alpha)
    assert (panel.scale.low, panel.scale.high) == pytest.approx((1, 3), abs=0.05)
    first, last = (torch.tensor(colormaps["viridis"](end)[:3]) for end in (0.0, 1.0))
    expected = torch.stack([first, 0.5 * last + 0.5, torch.ones(3)])[None]
    torch.testing.assert_close(panel.pixels, expected.float(), atol=1e-5, rtol=0)
    flat = map_cell("", torch.ones(1, 2), torch.ones(1, 2))
    assert (flat.scale.low, flat.scale.high) == (1, 2)
    assert map_cell("", torch.ones(1, 2), torch.zeros(1, 2)).scale == Scale(0, 1)


@pytest.mark.parametrize("points", [[(7, 9)], [(0, 0), (3, 30)], [(5, 12), (20, 14)], [(0, 0), (23, 35)]])
def test_the_frame_holds_all_that_is_visible(points):
    visible = torch.zeros(24, 36, dtype=torch.bool)
    visible[tuple(torch.tensor(points).T)] = True
    rows, columns = frame(visible)
    shown = visible[rows, columns]
    assert shown.sum() == len(points)
    height, width = shown.shape
    assert width == pytest.approx(1.5 * height, abs=1.5)
    assert height <= 24
    assert width <= 36
    nothing = torch.zeros_like(visible)
    assert nothing[frame(nothing)].shape == visible.shape


def test_each_view_has_a_row_of_fits_and_one_of_their_errors(tmp_path, views, drawn):
    write_comparison(tmp_path / "a.png", {name: RECIPES[name] for name in "abc"}, views)
    assert [row.name for row in drawn] == ["test view 0", "errors", "test view 1", "errors"]
    assert [panel.title for panel in drawn[0].cells] == ["ground truth", "a", "b", "c"]
    assert len({panel.words for panel in drawn[0].cells[1:]}) == 3
    (camera, *_), planes = cameras(2), ball_planes(views["test view 0"].camera)
    image = RECIPES["b"].render(camera).color.clamp(0, 1)
    error = ((image - planes[:3].permute(1, 2, 0)) ** 2).mean().item()
    of_b = float(drawn[0].cells[2].words.split()[1])
    assert of_b == pytest.approx(-10 * math.log10(error), abs=0.05)  # the views have 8 bits
    assert len({panel.pixels.shape for row in drawn for panel in row.cells if panel.pixels is not None}) == 1


def test_more_recipes_than_a_row_has_room_for_go_on_below(tmp_path, views, drawn):
    write_comparison(tmp_path / "a.png", RECIPES, {"view": views["test view 0"]})
    assert [[panel.title for panel in row.cells] for row in drawn[::2]] == [
        ["ground truth", "a", "b", "c"],
        ["ground truth", "d", "e", "f"],
    ]
    assert torch.equal(drawn[0].cells[0].pixels, drawn[2].cells[0].pixels)
    assert [len(line) for line in lines("abcdefg")] == [4, 3]
    assert [len(line) for line in lines("abcdefghi")] == [3, 3, 3]
    assert lines("ab") == ["ab"]
