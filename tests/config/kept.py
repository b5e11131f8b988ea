"""A project with a data set and its prepared volume, and a scene that tries functions on that."""

from dataclasses import asdict
from pathlib import Path

from tests.fields.surfels.test_composition import ball
from texgs.core.io import write_json
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.volume.generate import sphere
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.transfer import TransferFunction

DATA_SET = """\
# Mine: a shell around a core.
name: mine
title: my sphere  # as in tables
volume: {generator: sphere, size: 16}
tf_values: fraction

# From outside to inside.
basic_tfs:
    TF01: # glass
        opacity: [[0.3, 0.0], [0.4, 0.1], [0.5, 0.0]]
        color: [[0.3, 0.45, 0.68, 0.92]]
# opaque
    TF02:
        opacity:
            - [0.8, 0.0]
            - [0.9, 0.7]
            - [1.0, 0.9]
        color: [[0.8, 0.96, 0.62, 0.22], [1.0, 0.9, 0.4, 0.12]]
        # its colours are from elsewhere

# How edits look.
looks:
    TF01: {style: dots}
"""
TRIED = {  # shares of the range
    "TF03": [[0.6, 0], [0.65, 0.5], [0.7, 0]],
    "touching": [[0.5, 0], [0.65, 0.5], [0.8, 0]],
    "outer": [[0.1, 0], [0.2, 0.5], [0.25, 0]],
    "over": [[0.6, 0], [0.65, 0.5], [0.85, 0]],
    "TF02": [[0.6, 0], [0.65, 0.5], [0.7, 0]],
    "no name": [[0.6, 0], [0.65, 0.5], [0.7, 0]],
    "beyond": [[0.6, 0], [0.7, 0.5], [1.5, 0]],
    "nowhere": [[2, 0], [2.5, 0.5], [3, 0]],
}


def project(folder: Path, text: str = DATA_SET) -> Scene:
    """Write all of it to a folder, which the tests make the working directory; return the scene."""
    (folder / "conf" / "dataset").mkdir(parents=True)
    (folder / "conf" / "dataset" / "mine.yaml").write_bytes(text.encode())
    place = folder / "results" / "mine" / "volume"
    summary = prepare(ArraySource(sphere(16), "sphere"), place / "volume.nrrd")
    write_json(place / "volume.json", asdict(summary))
    write_json(place / "metrics.json", {"stage": "volume", "dataset": "mine"})
    width = summary.maximum - summary.minimum
    tried = {
        name: TransferFunction(
            [[summary.minimum + share * width, alpha] for share, alpha in points], [[0.0, 0.2, 0.4, 0.6]]
        )
        for name, points in TRIED.items()
    }
    models = {"TF01": SceneModel(write_model(folder / "TF01.safetensors", ball(1)))}
    volume = SceneVolume(place / "volume.nrrd", {"TF01": tried["outer"]})
    return Scene(models, volume=volume, functions=tried)
