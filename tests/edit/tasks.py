"""Edits of scenes as methods get them."""

import torch

from texgs.core.lens import Lens
from texgs.edit.keys import EditKeys
from texgs.edit.task import Task


class AnyViews(Task):
    """A task whose models have no training views."""

    def training_views(self, model):
        return []


def task(scene, output, parts=()):
    """An edit of parts of a scene, with no settings of a method."""
    edit = EditKeys("test", parts=list(parts))
    return AnyViews(None, edit, scene, {}, output, torch.device("cpu"), 1, Lens(), "test")
