import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from plyfile import PlyData

from tests.fields.surfels.ply_files import numbered, vertices
from tests.fields.surfels.samples import same, sample
from texgs.core.geometry import quats_to_matrices
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.ply import read_ply, write_ply
from texgs.fields.surfels.shading import ShadingModel, material, raw_material

RELEASED = ["diffuse_factor", "shininess", "ambient_factor", "specular_factor"]


@pytest.mark.parametrize("degree", [0, 1, 2, 3])
def test_properties_are_those_of_2dgs_and_3dgs(tmp_path, degree):
    model = sample("surfels", degree=degree)
    head = [*"xyz", "nx", "ny", "nz", *numbered("f_dc", 3), *numbered("f_rest", 3 * (degree + 1) ** 2 - 3)]
    data = PlyData.read(write_ply(tmp_path / "2.ply", model, "2dgs"))
    assert (data.text, data.byte_order) == (False, "<")
    assert [p.name for p in data["vertex"].properties] == [
        *head, "opacity", *numbered("scale", 2), *numbered("rot", 4)
    ]  # fmt: skip
    assert {p.val_dtype for p in data["vertex"].properties} == {"f4"}
    names = vertices(write_ply(tmp_path / "3.ply", model, "3dgs")).dtype.names
    assert list(names) == [*head, "opacity", *numbered("scale", 3), *numbered("rot", 4)]


def test_values_are_raw_and_harmonics_channel_major(tmp_path):
    model = sample("surfels")
    p, columns = model.parameters, vertices(write_ply(tmp_path / "m.ply", model, "3dgs"))
    for name, expected in (
        ("x", p["means"][:, 0]),
        ("opacity", p["opacities"]),
        ("scale_1", p["scales"][:, 1]),
        ("rot_0", p["quats"][:, 0]),
        ("f_dc_2", p["sh"][:, 0, 2]),
        ("f_rest_0", p["sh"][:, 1, 0]),
        ("f_rest_14", p["sh"][:, 15, 0]),
        ("f_rest_15", p["sh"][:, 1, 1]),
        ("f_rest_44", p["sh"][:, 15, 2]),
    ):
        np.testing.assert_array_equal(columns[name], expected.numpy(), err_msg=name)
    np.testing.assert_allclose(np.exp(columns["scale_2"]), 1e-6, rtol=1e-5)
    normals = np.stack([columns[name] for name in ("nx", "ny", "nz")], axis=1)
    np.testing.assert_array_equal(normals, quats_to_matrices(p["quats"])[..., 2].numpy())


@pytest.mark.parametrize("flavour", ["2dgs", "3dgs", "release"])
def test_colour_without_light_is_the_constant_harmonic(tmp_path, flavour):
    model = sample("shading", material="paper")
    columns = vertices(write_ply(tmp_path / "m.ply", model, flavour))
    expected = (model.parameters["colors"].numpy() - 0.5) / 0.28209479177387814
    assert columns.dtype["f_dc_0"] == np.float32
    for k in range(3):
        np.testing.assert_allclose(columns[f"f_dc_{k}"], expected[:, k], rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("flavour", ["2dgs", "release"])
def test_a_texture_becomes_its_mean(tmp_path, flavour):
    model = sample("texture", n=5)
    p = {**model.parameters, "texels": torch.randn(100, 3)}
    # In any order with gaps, as an atlas may be.
    p["sizes"] = torch.tensor([[1, 1], [2, 3], [4, 1], [3, 3], [1, 5]], dtype=torch.int32)
    p["offsets"] = torch.tensor([99, 50, 0, 60, 10])
    model = Surfels(p, ShadingModel(material="paper"))
    columns = vertices(write_ply(tmp_path / "m.ply", model, flavour))
    for n, (size, start) in enumerate(zip(p["sizes"].tolist(), p["offsets"].tolist(), strict=True)):
        mean = p["texels"][start : start + size[0] * size[1]].mean(0)
        color = 0.5 + 0.28209479177387814 * np.array([columns[f"f_dc_{k}"][n] for k in range(3)])
        np.testing.assert_allclose(color, (p["palette"] + p["colors"][n] + mean).numpy(), atol=2e-6)


def test_properties_of_the_release(tmp_path):
    model = sample("shading", material="paper")
    columns = vertices(write_ply(tmp_path / "m.ply", model, "release"))
    assert list(columns.dtype.names) == [
        *"xyz", *numbered("f_dc", 3), *numbered("f_rest", 45), "opacity", *numbered("normal", 3),
        *numbered("scale", 2), *numbered("rot", 4), *RELEASED,
    ]  # fmt: skip
    assert all(not columns[name].any() for name in numbered("f_rest", 45))
    for name in RELEASED:
        ours = model.parameters[name.removesuffix("_factor")]
        np.testing.assert_array_equal(columns[name], ours.numpy())


def test_the_release_finds_the_same_factors(tmp_path):
    """Its activations: k_a and k_d none, k_s = 5 sigmoid, beta = 50 sigmoid."""
    model = sample("shading")
    wanted = raw_material(0.3, 0.6, 0.2, 33.0, "bounded")
    lit = Surfels({**model.parameters, **wanted}, model.shading)
    columns = vertices(write_ply(tmp_path / "m.ply", lit, "release"))

    def sigmoid(x):
        return 1 / (1 + np.exp(-x.astype(np.float64)))

    np.testing.assert_allclose(columns["ambient_factor"], 0.3, rtol=1e-6)
    np.testing.assert_allclose(columns["diffuse_factor"], 0.6, rtol=1e-6)
    np.testing.assert_allclose(5 * sigmoid(columns["specular_factor"]), 0.2, rtol=1e-5)
    np.testing.assert_allclose(50 * sigmoid(columns["shininess"]), 33.0, rtol=1e-5)


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    n=st.integers(0, 5),
    degree=st.integers(0, 3),
    flavour=st.sampled_from(["2dgs", "3dgs"]),
)
def test_surfels_come_back_exactly(tmp_path_factory, seed, n, degree, flavour):
    model = sample("surfels", n, degree=degree, seed=seed)
    restored = read_ply(write_ply(tmp_path_factory.mktemp("p") / "m.ply", model, flavour))
    assert same(restored, model)
    assert restored.shading == ShadingModel(low_pass=2.0)


def test_tiny_surfels_come_back_from_3dgs(tmp_path):
    """Below the third scale that stands for flat."""
    model = sample("surfels")
    tiny = Surfels({**model.parameters, "scales": torch.full((7, 2), -20.0)})
    assert same(read_ply(write_ply(tmp_path / "m.ply", tiny, "3dgs")), tiny)


@settings(max_examples=100, deadline=None)
@given(color=st.lists(st.floats(0.25, 1, exclude_min=True, width=32), min_size=3, max_size=3))
def test_relightable_surfels_come_back_from_the_release(tmp_path_factory, color):
    model = sample("shading", n=1, material="paper", low_pass=2.0, facing=False)
    model = Surfels({**model.parameters, "colors": torch.tensor([color])}, model.shading)
    restored = read_ply(write_ply(tmp_path_factory.mktemp("p") / "m.ply", model, "release"))
    assert same(restored, model)
    assert restored.shading == model.shading


@settings(max_examples=100, deadline=None)
@given(color=st.floats(0, 0.25, width=32))
def test_dark_colours_come_back_to_a_rounding_of_a_half(tmp_path_factory, color):
    model = sample("shading", n=1)
    model = Surfels({**model.parameters, "colors": torch.full((1, 3), color)}, ShadingModel(material="paper"))
    restored = read_ply(write_ply(tmp_path_factory.mktemp("p") / "m.ply", model, "release"))
    assert float((restored.parameters["colors"] - color).abs().max()) <= 2**-25


def test_a_shared_material_goes_to_every_surfel(tmp_path):
    shared = raw_material(0.3, 0.6, 0.2, 33.0, "bounded")
    model = sample("shading")
    model = Surfels({**model.parameters, **shared}, model.shading)
    restored = read_ply(write_ply(tmp_path / "m.ply", model, "release"))
    expected = material(model.parameters, "bounded")
    for name, factor in material(restored.parameters, restored.shading.material).items():
        assert factor.shape == (7,)
        torch.testing.assert_close(factor, expected[name].expand(7), rtol=1e-5, atol=0)


@pytest.mark.parametrize("stage", ["shading", "texture"])
def test_without_material_only_the_colour_is_left(tmp_path, stage):
    restored = read_ply(write_ply(tmp_path / "m.ply", sample(stage), "2dgs"))
    assert restored.stage == "surfels"
    assert restored.parameters["sh"].shape == (7, 1, 3)
