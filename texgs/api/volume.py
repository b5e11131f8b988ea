"""A volume from an array, an ImageData of PyVista, a DataArray of xarray or a file."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from filecmp import cmp
from functools import partial
from html import escape
from inspect import signature
from operator import index
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from texgs.api.arrays import several, source_of
from texgs.api.display import as_python, inline, picture_of
from texgs.api.functions import AnyFunctions, Functions, named
from texgs.api.keywords import takes
from texgs.api.labels import sources_of
from texgs.config.project import is_name, name_of
from texgs.core.colors import color
from texgs.core.errors import ArgumentError
from texgs.core.names import close, mask_name
from texgs.scene.frame import quantize
from texgs.scene.scene import WHITE
from texgs.scene.scene_file import light_of
from texgs.scene.shot import Shot
from texgs.volume.basic_tfs import function_of
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.label_masks import INSIDE
from texgs.volume.matter import Matter
from texgs.volume.nrrd_file import open_grid
from texgs.volume.overlay import overlays
from texgs.volume.prepare import prepare_channels
from texgs.volume.render import Appearance
from texgs.volume.slabs import Source
from texgs.volume.slice_keys import SliceKeys
from texgs.volume.slice_picture import sample_at, slice_picture
from texgs.volume.slices import Place
from texgs.volume.sources import tells_superior
from texgs.volume.suggest import suggest
from texgs.volume.summaries import Summary, write_summaries

if TYPE_CHECKING:
    import pyvista
    from PIL.Image import Image

    from texgs.core.light import Light

CELL_WIDTH = 320  # pixels, of the picture at the end of a cell


class Volume:
    """A scalar field on a regular lattice, in a file of its own that is mapped, not read.

    The world is the volume, centred, with a longest side of 1. At the end of a cell it is a table and a
    picture with suggested transfer functions.

    Args:
        data: an array [Z, Y, X], image data of PyVista, a DataArray of xarray, or the path of a file or a
            folder of slices of any format that texgs reads.
        spacing: distance of samples along x, y, z; default that of the data, else 1.
        origin: position of the first sample, x, y, z; default that of the data, else 0.
        up: axis of the data that becomes +y of the world: "+y", "-y", "+z", ...; default "+z" of NIfTI and
            folders of DICOM, where it points to the head, else "+y".
        crop: x0, x1, y0, y1, z0, z1 in samples of the data, half open; default all.
        reduce: one sample for every block of reduce^3.
        method: "mean" of a block, or "sample", its middle, for labels.
        nan_value: takes the place of samples that are not finite, which are refused without it.
        kind: "image", or "labels": whole numbers that name what samples belong to, each a channel of its own.
        labels: beside an image, a file or an array of labels on its lattice; of a volume of labels, the names
            or numbers of those to show, default the 16 largest.
        names: table with names and colours of labels, of ITK-SNAP, FreeSurfer or 3D Slicer.
        name: of the volume, in titles; default that of the file, or "data".
        folder: for the file, of this volume alone; default one that is gone with the object.
        **keys: what only some formats take, such as `dims` and `dtype` of raw samples, see
            `texgs.volume.sources.open_source`.

    Raises:
        ArgumentError, ShapeError: if the data are no scalar field on a regular lattice, or a file cannot be
            read; in one sentence.
    """

    def __init__(
        self,
        data: Any,
        *,
        spacing: Sequence[float] | None = None,
        origin: Sequence[float] | None = None,
        up: str | None = None,
        crop: Sequence[int] | None = None,
        reduce: int = 1,
        method: str = "mean",
        nan_value: float | None = None,
        kind: str = "image",
        labels: Any = None,
        names: str | Path | None = None,
        name: str | None = None,
        folder: str | Path | None = None,
        **keys: Any,
    ) -> None:
        if name is not None and not isinstance(name, str):
            raise ArgumentError(f"name: expected words, got {name!r}")
        if keys and not isinstance(data, str | Path):
            hint = close(next(iter(keys)), signature(Volume).parameters)
            raise ArgumentError(f"{', '.join(keys)}: not for arrays{hint or '; leave them out'}")
        self.name = name = default_name(data) if name is None else name
        self._scratch = TemporaryDirectory(prefix="texgs-") if folder is None else None
        self.folder = Path(folder if folder is not None else self._scratch.name)  # type: ignore[union-attr]
        crop, nan_value = several("crop", crop, 6, index), as_python(nan_value)
        open_file = partial(source_of, name=name, spacing=spacing, origin=origin, keys=keys)
        shown, sources = sources_of(data, open_file, kind, labels, names, crop, reduce)
        self._channel = sources[0].channel
        if up is None:
            up = "+z" if isinstance(data, str | Path) and tells_superior(Path(data)) else "+y"
        how = {"crop": crop, "reduce": reduce, "method": method, "up": up, "nan_value": nan_value}
        self.summary, *others = self._prepared(sources, how)
        self.grid = open_grid(self.file)  # samples [Z, Y, X] with spacing and origin, +y up
        prepared = ["" if each.label is None else mask_name(each.label) for each in sources]
        self.channels = dict(zip(prepared, (self.summary, *others), strict=True))  # "" is an image
        write_summaries(self.file, [*self.channels.values()], prepared)
        self._labels = {name: function_of(tf, prepared) for name, tf in shown.items()}
        self._colors = {name: (tf.channel, tf(INSIDE)[:3]) for name, tf in self._labels.items()}

    @classmethod
    def from_pyvista(cls, image: pyvista.ImageData, **options: Any) -> Volume:
        """Return the volume of image data of PyVista; the same as `Volume(image)`."""
        return cls(image, **options)

    @property
    def file(self) -> Path:
        """Return the file, volume.nrrd, which ParaView opens, too."""
        return self.folder / "volume.nrrd"

    def _prepared(self, sources: list[Source], how: dict[str, Any]) -> list[Summary]:
        """Write the file; one of another volume, or that the data are in, is left alone."""
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise ArgumentError(
                f"folder: expected one, but {self.folder} cannot be made ({error.strerror})"
            ) from error
        with TemporaryDirectory(prefix=".volume-", dir=self.folder) as scratch:
            made = Path(scratch, self.file.name)
            summaries = prepare_channels(sources, made, **how)
            if self.file.exists() and not cmp(made, self.file, shallow=False):
                raise ArgumentError(
                    f"folder: expected one without another volume, got {self.file}; choose another folder, "
                    "or remove that file"
                )
            made.replace(self.file)
        if note := sources[0].note:
            warnings.warn(f"{self.name}: {note.replace('dataset.volume.', '')}", stacklevel=3)
        return summaries

    def suggest(self, count: int | None = None) -> Functions:
        """Return basic transfer functions by name: `count` of an image, what shows, and one of each label."""
        image = suggest(vars(self.summary), count, self._channel) if "" in self.channels else {}
        return Functions({**image, **self._labels}, self.channels)

    def render(
        self,
        functions: AnyFunctions | None = None,
        azimuth: float | None = None,
        polar: float = 20.0,
        width: int = 800,
        height: int | None = None,
        *,
        light: Light | str | tuple[float, float] | dict[str, Any] = "headlight",
        background: str | Sequence[float] = WHITE,
        step: float = Appearance().step,
    ) -> Image:
        """Return a picture by direct volume rendering, framed by what is visible.

        Args:
            functions: transfer functions, whose extinctions add up where they overlap; default those
                suggested.
            azimuth: of the camera, degrees; default 30, or a patient's front.
            polar: of the camera above the horizon, degrees.
            width: pixels.
            height: pixels; default the width.
            light: "headlight", azimuth and polar angle in degrees, or keys of a scene file's light such as
                `{"polar": 40, "shadows": 0.7}`.
            background: red, green, blue from 0 to 1, "#rrggbb" or a name such as "black".
            step: distance of samples along rays, voxels.
        """
        tfs = named(self.suggest() if functions is None else functions)
        look, shown, lit = replace(Appearance(), step=step), overlays(tfs), light_of(as_python(light))
        caster, cells = Caster(self.grid, look), None
        view = Shot(width, height, azimuth=azimuth, polar=polar).camera(frame_of(self.grid, tfs.values()))
        if lit.casts_shadows:
            cells = Matter(caster, shown, look.opacity_unit).under(lit)
        rgba = caster.cast(shown, view, lit, cells=cells).rgba
        behind = rgba.new_tensor(color("background", as_python(background)))
        return picture_of(quantize(rgba[..., :3] + (1 - rgba[..., 3:]) * behind))

    @takes(SliceKeys, "plane", "number")
    def slice(self, keys: SliceKeys) -> Image:
        """Return a picture of a slice, or of all three, with labels and a crosshair."""
        return picture_of(slice_picture(self.grid, keys, self._colors))

    def place(self, x: float, y: float, z: float) -> Place:
        """Return the sample closest to a place in the space of the file: its index, value and labels."""
        return sample_at(self.grid, (x, y, z), self._colors)

    def to_pyvista(self) -> pyvista.ImageData:
        """Return image data of PyVista in the space of the volume's file; the samples are not copied."""
        import pyvista

        image = pyvista.ImageData(
            dimensions=self.grid.dims, spacing=self.grid.spacing, origin=self.grid.origin
        )
        image.direction_matrix = self.grid.space.axes.T
        image.point_data[self.name] = self.grid.values.reshape(-1)
        return image

    def __repr__(self) -> str:
        """Return size, type and range."""
        known = self.summary
        size = " x ".join(map(str, known.dims))
        return f"Volume {self.name}: {size} {known.dtype}, {known.minimum:g} to {known.maximum:g}"

    def _repr_html_(self) -> str:
        """Return facts and a picture, for notebooks."""
        known = self.summary
        rows = {
            "samples": " x ".join(map(str, known.dims)),
            "type": known.dtype,
            "values": f"{known.minimum:g} to {known.maximum:g}",
            "spacing": ", ".join(f"{step:g}" for step in known.spacing),
        }
        cells = "".join(f"<tr><th>{key}</th><td>{escape(value)}</td></tr>" for key, value in rows.items())
        picture = inline(self.render(width=CELL_WIDTH), self.name)
        return f"<b>{escape(self.name)}</b><div>{picture}<table>{cells}</table></div>"


def default_name(data: Any) -> str:
    """Return the name of a file or folder, as a data set can have it; "data" where it has none."""
    name = name_of(Path(data)) if isinstance(data, str | Path) else ""
    return name if is_name(name) else "data"
