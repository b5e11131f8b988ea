"""A scan with labels: a scene of balls whose volume is a tilted hill with two labels in it."""

import numpy as np

from tests.scene.balls import ball_models
from texgs.scene.scene import Scene, SceneVolume
from texgs.volume.grid import Grid
from texgs.volume.label_masks import MaskSource
from texgs.volume.prepare import prepare_channels
from texgs.volume.slabs import ArraySource
from texgs.volume.space import LPS, Space
from texgs.volume.transfer import TransferFunction

SIZE = (20, 26, 31)  # Z, Y, X
SPACING, ORIGIN = (1.5, 1.0, 1.2), (-10.0, 5.0, 40.0)
RED, BLUE = (0.9, 0.1, 0.2), (0.2, 0.3, 0.9)
PATIENT = Space.along(np.diag([1.0, -1.0, 1.0]), LPS, "mm")  # y runs to the front


def label(channel, color):
    return TransferFunction(((127.5, 0.95), (255, 0.95)), ((127.5, *color),), channel)


def hill():
    """Values [Z, Y, X], uint8, that tell all axes from each other."""
    z, y, x = np.indices(SIZE)
    return (3 * x - 2 * y + 5 * z + 50).astype(np.uint8)


def labels():
    """Numbers of labels [Z, Y, X]: 1 in a block at low x, 2 in one at high x."""
    numbers = np.zeros(SIZE, np.uint8)
    numbers[4:14, 5:20, 3:14] = 1
    numbers[6:18, 8:22, 18:28] = 2
    return numbers


def labelled_scene(folder, *, with_image=True, **options):
    """A scene with the models `red` and `blue` of labels, and `hill` of the image, if it has one."""
    image, numbers = (
        ArraySource(Grid(each, SPACING, ORIGIN, space=PATIENT), "scan") for each in (hill(), labels())
    )
    sources = [MaskSource(numbers, 1), MaskSource(numbers, 2)]
    tfs = {"red": label(0, RED), "blue": label(1, BLUE)}
    if with_image:
        sources.insert(0, image)
        tfs = {"red": label(1, RED), "blue": label(2, BLUE)}
        tfs["hill"] = TransferFunction(((0, 0), (150, 0.4)), ((0, 0.5, 0.5, 0.5),))
    prepare_channels(sources, folder / "volume.nrrd")
    models = ball_models(folder, *tfs)
    return Scene(models, volume=SceneVolume(folder / "volume.nrrd", tfs), **options)
