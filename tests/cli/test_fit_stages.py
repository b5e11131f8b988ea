"""The three phases by hand, on views of a small sphere."""

import json
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.cli.conftest import TINY, copied
from texgs.cli.main import main
from texgs.core.geometry import z_order_of
from texgs.fields.surfels.model_file import read_model
from texgs.volume.view_set import read_views


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


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """Where phases will be written, in a folder without results."""
    monkeypatch.chdir(tmp_path)
    return tmp_path / "results" / "sphere" / "TF01" / "demo"


def numbers(folder, phase):
    return json.loads((folder / phase / "metrics.json").read_text())["numbers"]


def test_texture_makes_what_it_needs_first(fitted_sphere):
    folder = fitted_sphere / "sphere" / "TF01" / "demo"
    models = {
        phase: read_model(folder / phase / "model.safetensors") for phase in ("surfels", "shading", "texture")
    }
    assert {phase: model.stage for phase, model in models.items()} == {phase: phase for phase in models}
    assert models["texture"].metadata["dataset"] == "sphere"
    assert models["texture"].shading.local_viewer is False, "the CPU's volume mapper has a distant viewer"
    shading, texture = numbers(folder, "shading"), numbers(folder, "texture")
    assert shading["psnr"] > 25
    assert texture["psnr"] >= shading["psnr"] - 0.1
    assert texture["notes"]["texels"] == len(models["texture"].parameters["texels"])
    assert texture["sizes"]["total_mib"] > 0
    assert shading["losses"][-1] < 0.1


def test_surfels_lie_along_a_curve_with_all_that_is_theirs(fitted_sphere):
    folder = fitted_sphere / "sphere" / "TF01" / "demo"
    for phase in ("surfels", "shading", "texture"):
        means = read_model(folder / phase / "model.safetensors").parameters["means"]
        assert z_order_of(means).equal(torch.arange(400)), phase
    assert numbers(folder, "shading")["psnr"] > 25, "measured on surfels in this order"


def test_harmonics_first_as_in_the_paper(viewed):
    phase = ["fit.surfels.iterations=120", "fit.surfels.sh_every=40", "fit.surfels.densify.stop=0"]
    assert main(["shading", *TINY, *phase]) == 0
    model = read_model(viewed / "surfels" / "model.safetensors")
    assert model.parameters["sh"].shape[1:] == (16, 3)
    assert model.parameters["sh"][:, 9:].abs().max() > 0, "degree 3 has learned"
    assert numbers(viewed, "surfels")["psnr"] > 22
    assert "sh" not in read_model(viewed / "shading" / "model.safetensors").parameters


def test_a_material_per_surfel_on_request(seeded):
    main(["shading", *TINY, "fit.materials=surfel", "fit.shading.losses.smoothness=0.01"])
    ambient = read_model(seeded / "shading" / "model.safetensors").parameters["ambient"]
    assert len(ambient) == 400
    assert ambient.std() > 0.01


def test_same_seed_same_model(seeded):
    main(["shading", *TINY])
    first = (seeded / "shading" / "model.safetensors").read_bytes()
    main(["shading", "--force", *TINY])
    assert (seeded / "shading" / "model.safetensors").read_bytes() == first
    main(["shading", *TINY, "fit.seed=1"])
    other = seeded.with_name("demo-s1") / "shading" / "model.safetensors"
    assert other.read_bytes() != first


def test_the_time_before_an_interruption_counts(seeded, monkeypatch):
    from texgs.fit import checkpoint
    from texgs.fit.loop import Fit

    run = Fit.run

    def interrupted(fit):
        for done in run(fit):
            yield done
            if done == 50:
                raise KeyboardInterrupt

    monkeypatch.setattr(checkpoint, "SAVED_EVERY", 0.0)
    monkeypatch.setattr(Fit, "run", interrupted)
    assert main(["shading", *TINY]) == 130
    monkeypatch.setattr(Fit, "run", run)
    state = checkpoint.latest(seeded / ".shading.work" / "checkpoint")
    assert int(state["iteration"]) == 50
    monkeypatch.setattr(checkpoint, "latest", lambda _folder: {**state, "seconds": state["seconds"] + 1000})
    assert main(["shading", *TINY]) == 0
    assert numbers(seeded, "shading")["fit_seconds"] > 1000


def test_figure_shows_test_views_and_says_what_was_not_fitted(fitted, monkeypatch):
    from texgs.report import fit_figure

    drawn = []
    write = fit_figure.write_fit_figure
    monkeypatch.setattr(fit_figure, "write_fit_figure", lambda *args: drawn.append(args) or write(*args))
    assert main(["figure", *TINY]) == 0
    ((path, models, views, reduce, title),) = drawn
    assert list(models) == ["surfels", "shading", "texture"]
    assert [phase for phase, model in models.items() if model is None] == ["surfels"], "it only seeds them"
    assert list(views) == ["test view 0", "test view 1"]
    assert (reduce, title.partition(":")[0]) == (1, "sphere/TF01, recipe demo")
    assert path == Path("results/sphere/TF01/demo/.figure.work/figure.png")
    assert (fitted / "figure" / "figure.png").stat().st_size > 10_000
    assert numbers(fitted, "figure")["shown"] == ["test view 0", "test view 1"]


def test_figure_without_test_views_shows_training_views(fitted, monkeypatch):
    from texgs.report import fit_figure
    from texgs.volume import view_set

    shown = []
    read = view_set.read_views
    monkeypatch.setattr(view_set, "read_views", lambda folder: replace(read(folder), test=[]))

    def write(path, _models, views, *_):
        shown.extend(views)
        path.touch()

    monkeypatch.setattr(fit_figure, "write_fit_figure", write)
    assert main(["figure", *TINY]) == 0
    assert shown == ["training view 0", "training view 4"]


def test_a_gpu_that_is_not_there_is_one_sentence(seeded, capsys, monkeypatch):
    monkeypatch.setattr("torch.cuda.is_available", lambda: False)
    assert main(["shading", *TINY, "device.name=cuda"]) == 2
    assert "device=cuda: torch sees no GPU; leave it out to work on the CPU" in capsys.readouterr().err


def test_a_finished_phase_leaves_no_checkpoint(seeded, monkeypatch):
    from texgs.fit import checkpoint

    monkeypatch.setattr(checkpoint, "SAVED_EVERY", 0.0)
    assert main(["shading", *TINY]) == 0
    assert sorted(path.name for path in (seeded / "shading").iterdir() if path.name[0] != ".") == [
        "metrics.json",
        "model.safetensors",
    ]


def test_test_views_may_have_lights_of_their_own(folder):
    words = [*TINY, "views.test_lights=[{kind: directional, azimuth: 60, polar: 20}]"]
    assert main(["views", *words]) == 0
    views = read_views(folder.parent / "views")
    assert {view.light.kind for view in views.train} == {"headlight"}
    assert {(view.light.kind, view.light.azimuth) for view in views.test} == {("directional", 60.0)}
