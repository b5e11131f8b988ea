"""What a picture of slices shows; commands read it before anything large is imported."""

from dataclasses import dataclass

from texgs.core.keys import key
from texgs.core.names import check_window
from texgs.volume.view_settings import LARGEST


@dataclass(frozen=True)
class SliceKeys:
    """Which slices of a volume, and how."""

    plane: str = key("all", "axial, coronal, sagittal, or x, y, z in no patient's space; all: side by side")
    number: int | None = key(None, "of the slice, from 0; default through the place", least=0, option="slice")
    at: tuple[float, float, float] | None = key(
        None, "place that slices go through, in space and unit of the volume's file; default the middle"
    )
    window: tuple[float, float] | None = key(None, "values in black and white; default 99 % lie between")
    width: int = key(800, "of the picture", "pixels", least=16, most=LARGEST)

    def __post_init__(self) -> None:
        check_window(self.window)
