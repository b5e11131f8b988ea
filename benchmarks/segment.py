"""Segments: votes of the masks of 42 views, a mask without weights, and frames of a scene with a segment."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from benchmarks.fit import DISTANCE
from benchmarks.report import Measurement, Section
from benchmarks.scene import model
from benchmarks.settings import Settings
from benchmarks.timing import Case, measure
from texgs.core.camera import Camera, orbit
from texgs.edit.clicks import Clicks
from texgs.edit.lift import HEADLIGHT, ViewMasks
from texgs.edit.votes import CentreVotes, ContributionVotes
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.models.grabcut import GrabCut
from texgs.volume.cameras import icosphere

MOST = 512  # pixels of a view that votes
EDITS = [PartEdit(), PartEdit(palette=(0.2, 0.6, 0.4), opacity=0.7)]


def run(settings: Settings) -> Section:
    """Segment the half of a scene at positive x, by masks of where it makes up most of a pixel."""
    size = min(settings.size, MOST)
    whole = model(0, settings.device)
    half = whole.parameters["means"][:, 0] > 0
    cameras = [camera.to(settings.device) for camera in icosphere(2, DISTANCE, 30.0, size, size)]
    masks = truths(whole, half, cameras)
    where = {"size": size, "surfels": len(whole)}
    ways = {
        "contribution": lambda: ContributionVotes(whole),
        "contribution, plain": lambda: ContributionVotes(whole, rounds=0),
        "centre": lambda: CentreVotes(whole),
    }
    cases = [
        Case("votes", {**where, "by": name}, {"votes": lambda make=make: counted(make(), cameras, masks)})
        for name, make in ways.items()
    ]
    cases += [mask_case(whole, settings.device, size), *frame_cases(whole, half, settings)]
    section = Section(measure(cases, max(settings.rounds - 3, 1), settings.device, "segment"))
    weights = ContributionVotes(whole)
    for camera, mask in zip(cameras, masks, strict=True):
        weights.add(camera, mask)
    for name, make in ways.items():
        selected = counted(make(), cameras, masks)
        iou = float(weights.weights[selected & half].sum() / weights.weights[selected | half].sum())
        section.measurements.append(
            Measurement("IoU by contribution", {**where, "by": name}, "1", iou, iou, 1)
        )
    return section


def truths(whole: Surfels, half: Tensor, cameras: Sequence[Camera]) -> list[Tensor]:
    """Masks [H, W] of where a part of the surfels makes up most of a view."""
    shown = [ContributionVotes(whole).shown(camera, half.float()[:, None]) for camera in cameras]
    return [(x.color[..., 0] > 0.5 * x.alpha) & (x.alpha > 0.1) for x in shown]


def counted(
    votes: ContributionVotes | CentreVotes, cameras: Sequence[Camera], masks: Sequence[Tensor]
) -> Tensor:
    """Surfels that the masks of all views select."""
    for camera, mask in zip(cameras, masks, strict=True):
        votes.add(camera, mask)
    return votes.selected()


def mask_case(whole: Surfels, device: torch.device, size: int) -> Case:
    """A preview by GrabCut from one click in the middle of a view."""
    camera = orbit(-60.0, 25.0, DISTANCE, 30.0, size, size).to(device)
    middle = torch.full((1, 2), size / 2, device=device)
    clicks = Clicks(camera, middle, torch.ones(1, dtype=torch.bool, device=device))
    views = ViewMasks(whole, HEADLIGHT, GrabCut())
    return Case("GrabCut of a view", {"size": size}, {"mask": lambda: views.mask(clicks)})


def frame_cases(whole: Surfels, half: Tensor, settings: Settings) -> list[Case]:
    """Frames without a segment, with one that is not edited, and with one that is."""
    camera = orbit(-60.0, 25.0, DISTANCE, 30.0, settings.size, settings.size).to(settings.device)
    plain, split = Composition([whole]), Composition([whole], [[half]])
    shows = {
        "no segment": lambda: plain.render(camera),
        "as fitted": lambda: split.render(camera),
        "edited": lambda: split.render(camera, edits=EDITS),
    }
    return [
        Case("frame", {"size": settings.size, "scene": name}, {"frame": show}) for name, show in shows.items()
    ]
