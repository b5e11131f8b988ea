"""Slices of a scene's volume for its pages: pictures, and what is at a place."""

import asyncio
from contextlib import suppress
from dataclasses import asdict
from functools import cached_property
from typing import Any

import cv2
from aiohttp import web

from texgs.core.errors import ArgumentError, TexgsError
from texgs.scene.scene import volume_of
from texgs.viewer.messages import Place, Slice, parse
from texgs.viewer.origins import histogram_of
from texgs.viewer.page_volume import extremes
from texgs.viewer.shared_edits import SharedEdits
from texgs.volume.nrrd_file import open_grid
from texgs.volume.slices import place_at, planes_of, slice_of, windowed
from texgs.volume.summaries import summary_file

QUICK_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1)


class Slices:
    """Answers what pages ask of the volume of the scene that they share; its samples are mapped."""

    def __init__(self, edits: SharedEdits) -> None:
        self._edits = edits

    @cached_property
    def facts(self) -> dict[str, Any] | None:
        """Return planes and range of values; None where the scene names no volume that can be read."""
        with suppress(TexgsError):  # it is told to whoever shows the volume
            file = volume_of(self._edits.scene).file
            grid, (known, _) = open_grid(file), histogram_of(summary_file(file))
            return {
                "planes": [asdict(each) for each in planes_of(grid)],
                "window": known or extremes(grid.values),
            }
        return None

    async def picture(self, request: web.Request) -> web.StreamResponse:
        """Return the slice in the query as a PNG file."""
        asked = parse(request.query.get("slice", ""), Slice)
        return web.Response(body=await asyncio.to_thread(self._png, asked), content_type="image/png")

    async def place(self, request: web.Request) -> web.StreamResponse:
        """Return the sample at the place in the query, JSON; null beyond the outermost ones."""
        asked = parse(request.query.get("place", ""), Place)
        return web.json_response(await asyncio.to_thread(self._found, asked))

    def _png(self, asked: Slice) -> bytes:
        """Return a picture of a slice: a pixel a sample, from black to white."""
        grid = open_grid(volume_of(self._edits.scene).file)
        planes = {plane.name: plane for plane in planes_of(grid)}
        if asked.plane not in planes:
            raise ArgumentError(f"plane: expected one of {', '.join(planes)}, got {asked.plane!r:.100}")
        levels = windowed(slice_of(grid, planes[asked.plane], asked.number), *asked.window)
        return cv2.imencode(".png", levels, QUICK_PNG)[1].tobytes()

    def _found(self, asked: Place) -> dict[str, Any] | None:
        """Return index, position and value of the sample at a place, and the labels there."""
        place = place_at(open_grid(volume_of(self._edits.scene).file), asked.point)
        return {**asdict(place), "labels": []} if place else None
