"""What jobs read of the configuration: what all of them have, and what several share.

The module of a stage adds its own in a dataclass `Settings`; its function `select` takes the values from the
configuration. No field has a default, so a value that is not selected is an error.
"""

from dataclasses import dataclass

from texgs.config.dataset import BasicTF
from texgs.config.views import ViewKeys
from texgs.core.lens import Lens


@dataclass
class OfDataset:
    """A job of a data set."""

    stage: str
    dataset: str
    stand_in: str  # what the data stand in for


@dataclass
class OfTF(OfDataset):
    """A job of one basic TF."""

    tf: str


@dataclass
class FitLabel:
    """Which fit this is, and what it runs on."""

    name: str
    field: str  # a kind of field
    seed: int
    sweep: str
    variant: str
    device: str
    changed: bool  # from the file of its name


@dataclass
class Recipe(FitLabel):
    """The same, with what all stages of a fit read."""

    reduce: int


@dataclass
class Distance:
    """Where cameras of pictures of a scene stand."""

    radius: float  # world units
    fov_y: float  # degrees

    @property
    def lens(self) -> Lens:
        """Of these cameras, but for the size of images."""
        return Lens(self.radius, self.fov_y)


@dataclass
class OfScene(OfDataset):
    """A job that compares a scene with its volume."""

    tf_values: str
    basic_tfs: dict[str, BasicTF]
    views: ViewKeys
    fit: FitLabel
