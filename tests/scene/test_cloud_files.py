"""Files of clouds: what readers of their own find in them, what validators say, and how they look."""

from dataclasses import fields, replace

import numpy as np
import pytest
from pxr import Sdf, Usd, UsdGeom, UsdValidation

from tests.fields.gaussians.samples import sample as gaussians
from tests.fields.surfels.test_composition import CAMERA, ball
from tests.refusals import refused
from tests.scene.cloud_files import EXTENSION, READERS, drawn, glb, read_gltf, read_spz, read_usd
from tests.scene.test_export import plain
from texgs.core.light import HEADLIGHT
from texgs.fields.gaussians import Baked
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.metrics.quality import psnr
from texgs.scene.clouds import cloud_of
from texgs.scene.gltf import write_gltf
from texgs.scene.spz import write_spz
from texgs.scene.usd import write_usd

WRITERS = {".usda": write_usd, ".usdc": write_usd, ".glb": write_gltf, ".spz": write_spz}
WHITE = [1.0, 1.0, 1.0]


def cloud(model, name="TF01"):
    return cloud_of(name, (model, []), [PartEdit()], HEADLIGHT)


@pytest.fixture
def clouds():
    """Surfels with light, and 3D Gaussians of degree 3, whose names USD cannot take as they are."""
    return [cloud(ball(1)), cloud(ball(2, n=80), "a b"), cloud(gaussians(30), "a_b")]


def same(one, other, ignored=()):
    for field in fields(one):
        if field.name not in ignored:
            assert np.array_equal(getattr(one, field.name), getattr(other, field.name)), field.name


@pytest.mark.parametrize("ending", [".usda", ".usdc"])
def test_usd_holds_every_number(clouds, tmp_path, ending):
    written = write_usd(tmp_path / f"x{ending}", clouds)
    for read, given in zip(read_usd(written), clouds, strict=True):
        same(read, given)


def test_gltf_holds_every_number(clouds, tmp_path):
    for read, given in zip(read_gltf(write_gltf(tmp_path / "x.glb", clouds)), clouds, strict=True):
        same(read, given, ["is_flat", "antialiased"])


def test_spz_rounds(clouds, tmp_path):
    """To a step each: of coordinates 24 bits, others 8, quaternions 10."""
    (read,) = read_spz(write_spz(tmp_path / "x.spz", clouds))
    means, quats, scales, opacities = (
        np.concatenate([getattr(each, name) for each in clouds])
        for name in ("means", "quats", "scales", "opacities")
    )
    assert np.abs(read.means - means).max() <= 2**-20 * max(1, np.abs(means).max())
    assert np.abs((read.quats * quats).sum(axis=1)).min() > 1 - 1e-5
    assert np.abs(np.log(read.scales) - np.log(scales).clip(-10)).max() < 0.5001 / 16
    assert np.abs(read.opacities - opacities).max() < 0.5001 / 255
    sh = read.sh[:150]
    assert sh.shape[1] == 16
    assert np.abs(sh[:, 0] - clouds[0].sh[:, 0]).max() < 0.5001 / (255 * 0.15)
    assert np.abs(sh[:, 1:9] - clouds[0].sh[:, 1:].clip(-1, 127 / 128)).max() < 0.5001 / 128
    assert not sh[:, 9:].any()
    assert not read.antialiased, "the filter of Gaussians that are not"


def test_spz_holds_places_near_the_origin(clouds, tmp_path):
    for farthest in (1.9999999, 700.0, 3e6):
        means = np.full_like(clouds[0].means, -farthest)
        (read,) = read_spz(write_spz(tmp_path / "x.spz", [replace(clouds[0], means=means)]))
        assert np.allclose(read.means, means, rtol=1e-6)
        assert read.antialiased, "surfels are"
    (tmp_path / "x.spz").unlink()
    refused(
        lambda: write_spz(tmp_path / "x.spz", [replace(clouds[0], means=means * 5 / 3)]), r"x\.spz: .*5e\+06"
    )
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", READERS)
def test_an_opened_file_looks_like_the_scene(tmp_path, ending):
    models = [plain(1), plain(2)]
    expected = Composition(models).render(CAMERA).color
    shown = [cloud(model, name) for model, name in zip(models, "ab", strict=True)]
    read = READERS[ending](WRITERS[ending](tmp_path / f"x{ending}", shown))
    least = 36 if ending.startswith(".usd") else 28  # others are drawn by another kernel
    assert psnr(drawn(read, CAMERA, WHITE), expected) > least


@pytest.mark.parametrize("ending", READERS)
def test_opened_gaussians_look_as_before(tmp_path, ending):
    model = gaussians(300)
    moved = {**model.parameters, "means": 0.2 * model.parameters["means"]}
    model = replace(model, parameters=moved, shading=Baked(antialiased=ending == ".spz"))
    read = READERS[ending](WRITERS[ending](tmp_path / f"x{ending}", [cloud(model)]))
    assert psnr(drawn(read, CAMERA, WHITE), model.render(CAMERA).color) > (35 if ending == ".spz" else 90)


# -- USD ---


def complaints(stage):
    """What all validators of pxr say about a stage."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    assert len(validators) > 20
    return [str(error.GetMessage()) for error in UsdValidation.ValidationContext(validators).Validate(stage)]


def test_the_validators_of_usd_have_nothing_to_say(clouds, tmp_path):
    stage = Usd.Stage.Open(str(write_usd(tmp_path / "x.usdc", clouds)))
    assert complaints(stage) == []
    field = stage.GetRootLayer().GetPrimAtPath("/Scene/TF01")
    field.RemoveProperty(field.properties["opacities"])
    Sdf.AttributeSpec(field, "opacities", Sdf.ValueTypeNames.String)
    assert len(complaints(stage)) == 1, "they do see mistakes"


def test_prims_have_what_the_schema_of_usd_defines(clouds, tmp_path):
    stage = Usd.Stage.Open(str(write_usd(tmp_path / "x.usda", clouds)))
    assert UsdGeom.GetStageUpAxis(stage) == "Y"
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1
    root = stage.GetDefaultPrim()
    assert [each.GetName() for each in root.GetChildren()] == ["TF01", "a_b", "a_b_"]
    for prim, given in zip(root.GetChildren(), clouds, strict=True):
        assert prim.GetTypeName() == ("ParticleField" if given.is_flat else "ParticleField3DGaussianSplat")
        known = Usd.SchemaRegistry().BuildComposedPrimDefinition(prim.GetTypeName(), prim.GetAppliedSchemas())
        for name in prim.GetAuthoredPropertyNames():
            attribute = prim.GetAttribute(name)
            assert attribute.GetTypeName() == known.GetAttributeDefinition(name).GetTypeName()
            assert Usd.ColorSpaceAPI.ComputeColorSpaceName(attribute, None) == "srgb_rec709_scene"
        low, high = np.array(UsdGeom.Boundable(prim).GetExtentAttr().Get())
        assert (low < given.means.min(axis=0)).all()
        assert (high > given.means.max(axis=0)).all()


def test_usd_core_is_asked_for(clouds, tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pxr", None)
    refused(lambda: write_usd(tmp_path / "x.usda", clouds), r"x\.usda: .*usd-core 26\.3")
    assert not list(tmp_path.iterdir())


# -- glTF ---


def test_gltf_is_as_its_specification_and_that_of_the_extension_say(clouds, tmp_path):
    description, data = glb(write_gltf(tmp_path / "x.glb", clouds))
    assert description["extensionsUsed"] == [EXTENSION]
    assert description["buffers"] == [{"byteLength": len(data)}]
    for mesh, given in zip(description["meshes"], clouds, strict=True):
        (primitive,) = mesh["primitives"]
        assert primitive["mode"] == 0
        kernel = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
        assert primitive["extensions"] == {EXTENSION: kernel}
        degrees = range({9: 3, 16: 4}[given.sh.shape[1]])
        names = [f"SH_DEGREE_{degree}_COEF_{n}" for degree in degrees for n in range(2 * degree + 1)]
        expected = {f"{EXTENSION}:{name}" for name in (*names, "ROTATION", "SCALE", "OPACITY")}
        assert set(primitive["attributes"]) == expected | {"POSITION", "COLOR_0"}
        place = description["accessors"][primitive["attributes"]["POSITION"]]
        assert np.array_equal(np.float32(place["min"]), given.means.min(axis=0))
        assert np.array_equal(np.float32(place["max"]), given.means.max(axis=0))
    for view in description["bufferViews"]:
        assert view["byteOffset"] % 4 == view["byteLength"] % 4 == 0


def test_other_programs_show_gltf_as_points(clouds, tmp_path):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOGeometry import vtkGLTFReader

    reader = vtkGLTFReader()
    reader.SetFileName(str(write_gltf(tmp_path / "x.glb", clouds[:1])))
    reader.Update()
    found = reader.GetOutput()
    while not found.IsA("vtkPolyData"):
        found = found.GetBlock(0)
    assert np.array_equal(vtk_to_numpy(found.GetPoints().GetData()), clouds[0].means)
    colors = vtk_to_numpy(found.GetPointData().GetArray("COLOR_0"))
    shown = (0.5 + 0.28209479 * clouds[0].sh[:, 0]).clip(0, 1)
    linear = ((shown + 0.055) / 1.055) ** 2.4  # of all but very dark colours
    bright = shown > 0.05
    assert np.abs(colors[:, :3] - linear)[bright].max() < 1e-5
    assert np.allclose(colors[:, 3], clouds[0].opacities)
