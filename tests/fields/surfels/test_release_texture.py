import numpy as np
import torch

from tests.fields.surfels.ply_files import columns_of, numbered, write_vertices
from tests.fields.surfels.samples import sample
from tests.refusals import refused
from texgs.core.errors import ShapeError
from texgs.fields.files import kind_of
from texgs.fields.surfels.ply import read_ply, write_ply


def release_run(folder):
    """Files of the release's third stage: surfels, and textures that are stored along v first."""
    model = sample("shading", n=3, material="paper", low_pass=2.0, facing=False)
    path = write_ply(folder / "point_cloud.ply", model, "release")
    no_color = dict.fromkeys((*numbered("f_dc", 3), *numbered("f_rest", 45)))
    extra = {"scale_2": np.ones(3), "mappings_0": np.ones(3), "mappings_1": np.ones(3)}
    write_vertices(path, columns_of(path, **no_color, **extra))
    pictures = [np.random.default_rng(k).uniform(-0.3, 0.3, (2 + k, 4 - k, 3)) for k in range(3)]  # [U, V, 3]
    starts = np.cumsum([0, *(picture.size // 3 for picture in pictures)])
    dims = [(*picture.shape[:2], start) for picture, start in zip(pictures, starts, strict=False)]
    texels = np.concatenate([picture.reshape(-1, 3) for picture in pictures]).astype(np.float32)
    np.savez(
        folder / "texture.npz",
        texture_dc=texels,
        texture_dims=np.array(dims, np.int32),
        mappings=np.ones((3, 2)),
    )
    palette = torch.nn.Parameter(torch.tensor([0.9, 0.5, -0.2]))
    torch.save(([palette], 3000), folder / "palette_colors_chkpnt.pth")
    return path, model, pictures


def test_textures_of_the_release(tmp_path):
    path, relightable, pictures = release_run(tmp_path)
    assert kind_of(path).name == "surfels"
    model = read_ply(path)
    assert (model.stage, model.shading) == ("texture", relightable.shading)
    p = model.parameters
    for name in ("means", "quats", "scales", "opacities", "ambient", "shininess"):
        assert torch.equal(p[name], relightable.parameters[name])
    palette = np.array([0.9, 0.5, 0.0])
    np.testing.assert_allclose(p["palette"].numpy(), palette, rtol=1e-6)
    for n, picture in enumerate(pictures):
        n_u, n_v = p["sizes"][n].tolist()
        assert (n_u, n_v) == picture.shape[:2]
        for i in range(n_u):
            for j in range(n_v):
                ours = p["texels"][p["offsets"][n] + j * n_u + i] + p["palette"] + p["colors"][n]
                np.testing.assert_allclose(ours, np.clip(picture[i, j] + palette, 0, 1), atol=1e-6)


def test_files_missing_or_foreign_beside_the_release_are_named(tmp_path):
    path, *_ = release_run(tmp_path)
    palette, texture = tmp_path / "palette_colors_chkpnt.pth", tmp_path / "texture.npz"
    dims = np.array([[2, 2, 0], [2, 2, 4], [2, 2, 8]], np.int32)
    np.savez(texture, texture_dc=np.zeros((11, 3), np.float32), texture_dims=dims)
    refused(lambda: read_ply(path), "within the 11 texels")
    for content in (b"", b"not a palette", palette.read_bytes()[:50]):
        palette.write_bytes(content)
        refused(lambda: read_ply(path), "a palette as the release")
    for saved in (torch.zeros(3), {"a": 1}, ([], 3), ([3], 3)):
        torch.save(saved, palette)
        refused(lambda: read_ply(path), "a palette as the release")
    palette.unlink()
    refused(lambda: read_ply(path), r"palette_colors_chkpnt\.pth: no such file")
    np.savez(texture, texture_dc=np.zeros((4, 3)), texture_dims=np.array([[2, 2, 0]] * 2))
    refused(lambda: read_ply(path), "texture_dims: ", ShapeError)
    np.savez(texture, other=np.zeros(3))
    refused(lambda: read_ply(path), "texture_dc and texture_dims")
    texture.unlink()
    refused(lambda: read_ply(path), r"texture\.npz: no such file")
