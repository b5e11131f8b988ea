import pytest
import torch

from tests.fields.surfels.samples import STAGES, sample
from texgs.fields.surfels.groups import sizes
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model

N_TEXELS = 10_000_000  # per basic scene, found by a bisection of 0.1 %

# Paper, appendix, model size breakdown: basic scenes, geometry, shading, texture in MiB, primitives.
PAPER = {
    "beetle": (1, 1.8, 0.7, 114.5, 47767),
    "ionization": (2, 4.6, 1.8, 228.9, 119396),
    "wood": (1, 5.3, 2.1, 114.5, 138087),
    "mantle": (2, 6.9, 2.7, 228.9, 179688),
}


@pytest.mark.parametrize("dataset", PAPER)
def test_counts_what_the_paper_counts(dataset):
    n_scenes, geometry, shading, texture, n = PAPER[dataset]
    whole = sample("texture", n=1)
    per_surfel = (
        "means",
        "quats",
        "scales",
        "opacities",
        "colors",
        "ambient",
        "diffuse",
        "specular",
        "shininess",
    )
    # Expanded views: as large as the paper's models, without the memory.
    p = {name: x.expand(n, *x.shape[1:]) for name, x in whole.parameters.items() if name in per_surfel}
    p |= {"palette": torch.zeros(3), "texels": torch.zeros(1, 3).expand(n_scenes * N_TEXELS, 3)}
    p |= {"sizes": torch.ones(1, 2, dtype=torch.int32).expand(n, 2), "offsets": torch.arange(n)}
    by_group = Surfels(p).sizes()
    assert round(by_group["geometry_mib"], 1) == geometry
    assert round(by_group["shading_mib"], 1) == shading
    assert by_group["texture_mib"] == pytest.approx(texture, rel=1e-3)
    assert by_group["total_mib"] == pytest.approx(geometry + shading + texture, rel=1e-3)


@pytest.mark.parametrize("stage", STAGES)
def test_stored_is_the_file_without_its_header(tmp_path, stage):
    model = sample(stage, n=500)
    data = write_model(tmp_path / "m", model).read_bytes()
    header = 8 + int.from_bytes(data[:8], "little")
    by_group = model.sizes()
    assert by_group["stored_total_mib"] * 2**20 == pytest.approx(len(data) - header, abs=1e-6)
    groups = ("stored_geometry_mib", "stored_shading_mib", "stored_texture_mib")
    assert by_group["stored_total_mib"] == pytest.approx(sum(by_group[group] for group in groups))
    assert header < 2048


@pytest.mark.parametrize(("surfels", "published"), [(129857, 223), (108119, 221)], ids=["image", "text"])
def test_files_are_as_large_as_in_the_papers_tables_of_edits(surfels, published):
    """Means over four data sets of seven basic scenes with ten million texels each."""
    p = {"means": torch.zeros(1, 3).expand(surfels, 3), "texels": torch.zeros(1, 3).expand(17_500_000, 3)}
    assert round(sizes(p)["files_mib"] * 2**20 / 1e6) == published


def test_groups():
    by_group = sample("shading", n=64, shared=True).sizes()
    assert by_group["geometry_mib"] == 64 * 40 / 2**20
    assert by_group["shading_mib"] == 4 * 4 / 2**20
    assert by_group["stored_shading_mib"] == (64 * 12 + 4 * 4) / 2**20
    assert by_group["texture_mib"] == by_group["stored_texture_mib"] == 0
    assert sample("surfels").sizes()["shading_mib"] == 0
