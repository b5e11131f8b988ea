"""The three phases by hand, and a fit of 3D Gaussians, on views of a small sphere."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.cli.conftest import GAUSSIANS, SPHERE, TINY, copied, numbers
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.geometry import z_order_of
from texgs.fields.files import open_field
from texgs.fields.gaussians import JoinedGaussians
from texgs.fields.surfels.model_file import read_model
from texgs.fitting import checkpoint
from texgs.fitting.loop import Fit
from texgs.report import fit_figure
from texgs.scene.scene_file import read_scene
from texgs.volume import view_set

pytestmark = pytest.mark.stages


@pytest.fixture
def fitted(fitted_sphere, tmp_path, monkeypatch):
    """The folder of the phases in a copy of finished results."""
    monkeypatch.chdir(copied(fitted_sphere, tmp_path))
    return tmp_path / "results" / "sphere" / "TF01" / "demo"


@pytest.fixture
def seeded(fitted):
    """The same before the shading phase: there are views, and surfels at seeds."""
    for phase in ("shading", "texture"):
        shutil.rmtree(fitted / phase)
    return fitted


@pytest.fixture
def viewed(seeded):
    """The same before all phases: there are only views."""
    shutil.rmtree(seeded)
    return seeded


def shown_files(folder):
    return sorted(path.name for path in folder.iterdir() if path.name[0] != ".")


def test_texture_makes_what_it_needs_first(fitted_sphere):
    folder = fitted_sphere / "sphere" / "TF01" / "demo"
    models = {
        phase: read_model(folder / phase / "model.safetensors") for phase in ("surfels", "shading", "texture")
    }
    assert {phase: model.stage for phase, model in models.items()} == {phase: phase for phase in models}
    assert models["texture"].metadata["dataset"] == "sphere"
    assert models["texture"].shading.local_viewer is False, "the CPU's caster has a distant viewer"
    shading, texture = numbers(folder / "shading"), numbers(folder / "texture")
    for phase, model in models.items():
        order = z_order_of(model.parameters["means"])
        assert order.equal(torch.arange(400)), f"{phase}: along a curve, with all that is theirs"
    assert shading["psnr"] > 22, "measured on surfels in this order"
    assert texture["psnr"] >= shading["psnr"] - 0.1
    assert texture["relit_psnr"] > 22, "under lights that no training view has"
    assert 0 < texture["relit_ssim"] <= 1
    assert "relit_psnr" not in shading
    assert texture["notes"]["texels"] == len(models["texture"].parameters["texels"])
    assert texture["sizes"]["total_mib"] > 0
    assert shading["losses"][-1] < 0.1


def test_harmonics_first_as_in_the_paper(viewed):
    phase = ["fit.surfels.iterations=120", "fit.surfels.sh_every=40", "fit.surfels.densify.stop=0"]
    assert main(["shading", *TINY, *phase]) == 0
    model = read_model(viewed / "surfels" / "model.safetensors")
    assert model.parameters["sh"].shape[1:] == (16, 3)
    assert model.parameters["sh"][:, 9:].abs().max() > 0, "degree 3 has learned"
    assert numbers(viewed / "surfels")["psnr"] > 20
    assert "sh" not in read_model(viewed / "shading" / "model.safetensors").parameters


def test_there_are_as_many_seeds_as_the_first_phase_with_iterations_keeps(viewed):
    few = ["fit=demo", "fit.shading.densify.cap=300", "fit.surfels.densify={cap: 350, stop: 0}"]
    for iterations, expected in ((0, 300), (1, 350)):
        assert main(["surfels", *SPHERE, *few, f"fit.surfels.iterations={iterations}", "--replace"]) == 0
        assert numbers(viewed / "surfels")["primitives"] == expected


def test_parts_that_are_missing_are_told_once_after_the_last_phase(viewed, capsys):
    few = ["fit.seeds.count=8", "fit.shading.iterations=5"]
    assert main(["texture", *TINY, *few]) == 0
    share = numbers(viewed / "texture")["shown"]
    (told,) = [line for line in capsys.readouterr().err.splitlines() if "parts are missing" in line]
    assert share < 0.9
    assert told.startswith(
        f"sphere/TF01: texture: the model shows {100 * share:.1f} % of what test views show"
    )
    assert main(["texture", *TINY, "--replace"]) == 0
    assert numbers(viewed / "texture")["shown"] > 0.995
    assert "parts are missing" not in capsys.readouterr().err


def test_materials_of_each_surfel_and_normals_of_their_own_or_of_planes(seeded):
    main(["shading", *TINY, "fit.materials=surfel", "fit.shading.losses.smoothness=0.01"])
    p = read_model(seeded / "shading" / "model.safetensors").parameters
    assert len(p["ambient"]) == 400
    assert p["ambient"].std() > 0.01
    assert not torch.equal(p["normals"], p["quats"]), "both have learned"
    main(["shading", *TINY, "fit.normals=surfel", "--replace"])
    assert "normals" not in read_model(seeded / "shading" / "model.safetensors").parameters


def test_same_seed_same_model(seeded):
    main(["shading", *TINY])
    first = (seeded / "shading" / "model.safetensors").read_bytes()
    main(["shading", "--force", *TINY])
    assert (seeded / "shading" / "model.safetensors").read_bytes() == first
    main(["shading", *TINY, "fit.seed=1"])
    other = seeded.with_name("demo-s1") / "shading" / "model.safetensors"
    assert other.read_bytes() != first


def test_the_time_before_an_interruption_counts(seeded, monkeypatch):
    run = Fit.run

    def interrupted(fit):
        for done in run(fit):
            yield done
            if done == 50:
                raise KeyboardInterrupt

    monkeypatch.setattr(checkpoint, "SAVE_INTERVAL", 0.0)
    monkeypatch.setattr(Fit, "run", interrupted)
    assert main(["shading", *TINY]) == 130
    monkeypatch.setattr(Fit, "run", run)
    state = checkpoint.latest(seeded / ".shading.work" / "checkpoint")
    assert int(state["iteration"]) == 50
    monkeypatch.setattr(checkpoint, "latest", lambda _folder: {**state, "seconds": state["seconds"] + 1000})
    assert main(["shading", *TINY]) == 0
    assert numbers(seeded / "shading")["fit_seconds"] > 1000
    assert shown_files(seeded / "shading") == ["metrics.json", "model.safetensors"], "no checkpoint is left"


def test_figure_shows_test_views_and_the_phases_that_fit(fitted, monkeypatch):
    drawn = []
    write = fit_figure.write_fit_figure
    monkeypatch.setattr(fit_figure, "write_fit_figure", lambda *args: drawn.append(args) or write(*args))
    assert main(["figure", *TINY]) == 0
    ((path, models, views, reduce, title),) = drawn
    assert list(models) == ["shading", "texture"], "surfels are only seeded"
    assert list(views) == ["test view 0", "test view 1"]
    assert (reduce, title.partition(":")[0]) == (1, "sphere/TF01, recipe demo")
    assert path == Path("results/sphere/TF01/demo/.figure.work/figure.png")
    assert (fitted / "figure" / "figure.png").stat().st_size > 10_000
    assert numbers(fitted / "figure")["shown"] == ["test view 0", "test view 1"]


def test_figure_without_test_views_shows_training_views(fitted, monkeypatch):
    read = view_set.read_views
    monkeypatch.setattr(view_set, "read_views", lambda folder: replace(read(folder), test=[]))
    assert main(["figure", *TINY]) == 0
    assert numbers(fitted / "figure")["shown"] == ["training view 0", "training view 4"]


def test_a_fit_has_a_model_and_numbers_and_leaves_no_checkpoint(gaussians):
    folder = gaussians / "sphere" / "TF01" / "gaussians_quick" / "gaussians"
    told = numbers(folder.parent / "gaussians")
    assert told["psnr"] > 25
    assert told["sizes"]["total_mib"] * 2**20 == pytest.approx(400 * 248)
    field = open_field(folder / "model.safetensors")
    assert (field.kind, len(field)) == ("gaussians", 400)
    assert field.parameters["sh"][:, 9:].abs().max() > 0, "degree 3 has learned"
    assert shown_files(folder) == ["metrics.json", "model.safetensors"]


def test_a_scene_opens_and_fades(gaussians, tmp_path):
    path = gaussians / "sphere" / "scene" / "gaussians_quick" / "compose" / "scene.yaml"
    whole = read_scene(path)
    composed = whole.open()
    assert isinstance(composed, JoinedGaussians)
    assert main(["edit", str(path), "TF01.opacity=0.2", "--output", str(tmp_path / "faint.yaml")]) == 0
    faint = read_scene(tmp_path / "faint.yaml")
    camera = orbit(30, 20, 2.5, 50, 48, 48)
    before, after = (composed.render(camera, edits=scene.edits).alpha.sum() for scene in (whole, faint))
    assert float(after) < 0.8 * float(before)
    palette = ["TF01.palette=#ff0000", "--output", str(tmp_path / "red.yaml")]
    assert main(["edit", str(path), *palette]) == 2


def test_two_recipes_side_by_side_are_fitted_first(gaussians, tmp_path, monkeypatch):
    monkeypatch.chdir(copied(gaussians, tmp_path))
    few = ["fits=[gaussians_quick,demo]", "fit.shading.iterations=10"]
    assert main(["comparison", *SPHERE, *GAUSSIANS, *few]) == 0
    folder = tmp_path / "results" / "sphere" / "TF01"
    shown = {"recipes": ["gaussians_quick", "demo"], "shown": ["test view 0", "test view 1"]}
    assert numbers(folder / "comparison" / "looks") == shown
    assert (folder / "comparison" / "looks" / "comparison.png").stat().st_size > 1000
    assert (folder / "demo" / "texture" / "model.safetensors").exists()
