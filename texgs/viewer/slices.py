"""Slices of a scene's volume for its pages: pictures, and what is at a place."""

import asyncio
from contextlib import suppress
from dataclasses import asdict
from functools import cached_property, partial
from typing import Any

import cv2
from aiohttp import web

from texgs.core.errors import TexgsError
from texgs.scene.scene import volume_of
from texgs.scene.session import Session
from texgs.viewer.messages import Place, Slice, parse
from texgs.volume.grid import Grid
from texgs.volume.label_masks import shows_label
from texgs.volume.slices import Labels, place_at, planes_of, slice_colors, slice_of, window_of


class Slices:
    """Answers what pages ask of the volume of a session's scene; its samples are mapped."""

    def __init__(self, session: Session) -> None:
        self._session = session

    @cached_property
    def facts(self) -> dict[str, Any] | None:
        """Return the planes and a window; None where the scene names no volume that can be read."""
        with suppress(TexgsError):  # it is told to whoever shows the volume
            grid = volume_of(self._session.scene).open()
            return {"planes": [asdict(each) for each in planes_of(grid)], "window": window_of(grid)}
        return None

    async def picture(self, request: web.Request) -> web.StreamResponse:
        """Return the slice in the query as a PNG file."""
        asked = parse(request.query.get("slice", ""), Slice)
        return web.Response(body=await asyncio.to_thread(self.png, asked), content_type="image/png")

    async def place(self, request: web.Request) -> web.StreamResponse:
        """Return the sample at the place in the query, JSON; null beyond the outermost ones."""
        asked = parse(request.query.get("place", ""), Place)
        return web.json_response(await asyncio.to_thread(self.found, asked))

    def png(self, asked: Slice) -> bytes:
        """Return a picture of a slice, a pixel a sample: the values in a window, and labels over them."""
        grid, labels = self._open()
        values = partial(slice_of, grid, planes_of(grid)[asked.plane], asked.number)
        colors = slice_colors(values, asked.window, labels)
        pixels = colors[..., ::-1] if labels else colors[..., 0]  # three channels take three times as long
        return cv2.imencode(".png", pixels, [cv2.IMWRITE_PNG_COMPRESSION, 1])[1].tobytes()

    def found(self, asked: Place) -> dict[str, Any] | None:
        """Return index, position and value of the sample at a place, and the labels there."""
        grid, labels = self._open()
        place = place_at(grid, asked.point, labels)
        return asdict(place) if place else None

    def _open(self) -> tuple[Grid, Labels]:
        """Map the volume of the scene as it is now, and return its labels in their colours."""
        scene = self._session.scene  # which another thread may change
        palettes = self._session.composition_of(scene).palettes
        has_labels = any(map(shows_label, volume_of(scene).tfs.values()))
        labels = self._session.twin_of(scene).labels(scene, palettes) if has_labels else {}
        return volume_of(scene).open(), labels
