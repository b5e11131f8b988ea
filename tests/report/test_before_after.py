"""What the pictures of an edit show depends on what its kind of field can do."""

from dataclasses import replace

import av
import pytest
import torch

from tests.fields.surfels.test_composition import ball
from tests.scene.balls import balls_in_a_volume
from texgs.core.lens import Lens
from texgs.core.light import Light
from texgs.fields.kinds import kinds
from texgs.fields.surfels.model_file import write_model
from texgs.report import before_after
from texgs.report.before_after import write_before_and_after
from texgs.report.compared import chain, light_sweep
from texgs.scene.film import Film
from texgs.scene.scene import Scene, SceneModel

SURFELS = kinds()["surfels"]


@pytest.mark.parametrize(
    ("kind", "columns"), [(SURFELS, 4), (replace(SURFELS, can=frozenset(), film_size=64), 3)]
)
def test_only_what_can_be_relit_is_shown_under_another_light(kind, columns, tmp_path, monkeypatch, capsys):
    write_model(tmp_path / "ball.safetensors", ball(1))
    scene = Scene({"ball": SceneModel(tmp_path / "ball.safetensors")})
    monkeypatch.setattr(before_after, "TURNTABLE_FRAMES", 3)
    grids = []
    monkeypatch.setattr(before_after, "write_grid", lambda path, rows, titles: grids.append((rows, titles)))
    write_before_and_after(scene, scene, kind, Lens(), tmp_path, torch.device("cpu"), "ball")
    ((rows, titles),) = grids
    assert [len(row) for row in rows.values()] == [columns, columns]
    assert len(titles) == columns
    assert ("light from the side" in titles) == (columns == 4)
    with av.open(tmp_path / "turntable.mp4") as film:
        stream = film.streams.video[0]
        assert (stream.width, stream.height) == (2 * kind.film_size, kind.film_size)
        assert len(list(film.decode(stream))) == 3
    assert "ball, after: " in (log := capsys.readouterr().err)
    assert "ball, turntable: 3 of 3 frames" in log


def test_lights_that_move_keep_the_shadows_of_the_scene(tmp_path):
    light = Light("headlight", shadows=0.7, occlusion=0.5, reach=0.3)
    scene = replace(balls_in_a_volume(tmp_path), light=light)
    shown = [each for _, each in Film(what="light", frames=3).shots(scene)]
    shown += [*light_sweep(scene).values(), list(chain(scene, [], ()).values())[-1]]
    assert len({each.light.polar for each in shown}) > 3
    for each in shown:
        assert each.light == replace(
            light, kind="directional", azimuth=each.light.azimuth, polar=each.light.polar
        )
