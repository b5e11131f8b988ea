"""A scene of several channels of a volume: its twin, its file, and what a page of it carries."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml

from tests.fields.surfels.samples import sample
from tests.refusals import refused
from texgs.core.camera import orbit
from texgs.core.cuts import Cuts, Plane
from texgs.core.light import Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.twin import Twin, range_of
from texgs.viewer.downloads import exports_of
from texgs.viewer.origins import Origins
from texgs.viewer.page_volume import page_volume
from texgs.volume.caster import Caster
from texgs.volume.generate import sphere
from texgs.volume.grid import Grid
from texgs.volume.nrrd_file import open_grid
from texgs.volume.prepare import prepare_channels
from texgs.volume.render import Appearance
from texgs.volume.slabs import ArraySource
from texgs.volume.transfer import TransferFunction

CAMERA, SIDE = orbit(20, 10, 3, 30, 40, 40), Light("directional", 110, 20)
LOOK = Appearance(ambient=0.4, step=0.5, opacity_unit=0.02)
PALETTES = [(0.2, 0.4, 0.9), (0.3, 0.9, 0.2)]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A sphere, and the same sphere mirrored along a ramp, each in its channel."""
    folder = tmp_path_factory.mktemp("scene")
    first = sphere(24).values
    second = first * np.linspace(0.2, 1, 24, dtype=np.float32)
    prepare_channels([ArraySource(Grid(values)) for values in (first, second)], folder / "volume.nrrd")
    tfs = {}
    for channel, (values, color) in enumerate(zip((first, second), PALETTES, strict=True)):
        low, high = float(values.min()), float(values.max())
        points = ((low + 0.4 * (high - low), 0.0), (high, 0.3))
        tfs[f"C{channel}"] = TransferFunction(points, ((0, *color),), channel)
    file = write_model(folder / "model.safetensors", sample())
    models = {name: SceneModel(file) for name in tfs}
    return Scene(models, SIDE, (0.0, 0.0, 0.0), volume=SceneVolume(folder / "volume.nrrd", tfs, LOOK))


def shown(scene):
    seen = Twin(scene).render(CAMERA, scene, PALETTES)
    return torch.cat([seen.color, seen.alpha[..., None]], dim=-1).numpy()


def cast(scene, tfs, **options):
    return Caster(open_grid(scene.volume.file), LOOK).cast(tfs, CAMERA, scene.light, **options).rgba.numpy()


def with_edit(scene, name, **values):
    return replace(scene, models={**scene.models, name: replace(scene.models[name], edit=PartEdit(**values))})


def test_the_twin_casts_all_channels_together(scene):
    first, second = scene.volume.tfs.values()
    np.testing.assert_array_equal(shown(scene), cast(scene, [first, second]))
    alone = cast(scene, second)
    np.testing.assert_array_equal(shown(with_edit(scene, "C0", visible=False)), alone)
    assert shown(scene)[..., 3].sum() > alone[..., 3].sum()


def test_edits_of_a_channel_reach_its_function_alone(scene):
    first, second = scene.volume.tfs.values()
    edited = with_edit(scene, "C1", palette=(0.9, 0.1, 0.4), opacity=0.5)
    points = [(value, 0.5 * alpha) for value, alpha in second.opacity]
    expected = TransferFunction(points, ((0, 0.9, 0.1, 0.4),), 1)
    np.testing.assert_allclose(shown(edited), cast(scene, [first, expected]), atol=1e-6)


def test_cuts_open_all_channels(scene):
    cut = replace(scene, cuts=Cuts([Plane([0.0, 0.0, 1.0], 0.0)]))
    cuts = range_of(cut.cuts, CAMERA)
    tfs = [*scene.volume.tfs.values()]
    expected = cast(scene, tfs, depth_range=cuts.depth_range, faces=cuts, lit_faces=True)
    np.testing.assert_array_equal(shown(cut), expected)
    assert not np.array_equal(shown(cut), shown(scene))


def test_a_scene_file_has_the_number_of_a_channel_but_the_first(scene, tmp_path):
    file = write_scene(tmp_path / "scene.yaml", scene)
    tfs = yaml.safe_load(file.read_text())["volume"]["tfs"]
    assert ("channel" in tfs["C0"], tfs["C1"]["channel"]) == (False, 1)
    assert read_scene(file).volume.tfs == scene.volume.tfs


def test_a_channel_that_the_volume_lacks_is_told(scene):
    wrong = {**scene.volume.tfs, "C1": replace(scene.volume.tfs["C1"], channel=2)}
    broken = replace(scene, volume=replace(scene.volume, tfs=wrong))
    refused(lambda: shown(broken), "channel: expected one of 0 to 1, got 2")


def test_a_page_carries_the_channels_that_functions_use_and_has_an_editor_of_the_first_alone(scene):
    # Slices show the first.
    for names, numbers in ((("C0",), [0]), (("C1",), [0, 1]), (("C0", "C1"), [0, 1])):
        tfs = {name: scene.volume.tfs[name] for name in names}
        shown = replace(scene, volume=replace(scene.volume, tfs=tfs))
        carried = page_volume(shown, 1.0)
        assert [each["number"] for each in carried.describe(shown)["channels"]] == numbers
        assert len(carried.codes) == len(numbers) * len(open_grid(scene.volume.file).values)
        assert (Origins(shown).transfer is None) is (1 in numbers)
        assert "volume" in exports_of(shown)
    masked = {"C0": replace(scene.volume.tfs["C0"], within=1)}
    assert page_volume(replace(scene, volume=replace(scene.volume, tfs=masked)), 1.0).numbers == [0, 1]
