"""Which configurations go through a stage."""

from collections.abc import Callable

from omegaconf import DictConfig

from texgs.edit.method import NO_METHOD, methods
from texgs.fields.kinds import kinds
from texgs.workflow.inputs import with_recipe
from texgs.workflow.variants import changes


def is_fit(config: DictConfig) -> bool:
    """Whether a configuration is of views and fits; the scene that is edited is that of another one."""
    return bool(config.edit.method == NO_METHOD)


def is_fit_of(kind: str) -> Callable[[DictConfig], bool]:
    """Whether a configuration is of fits of a kind of field."""
    return lambda config: is_fit(config) and config.fit.field == kind


def has_volume(config: DictConfig) -> bool:
    """Whether the data set starts from a volume, not from views."""
    return is_fit(config) and config.dataset.views_folder is None


def has_mesh(config: DictConfig) -> bool:
    """Whether a mesh is made of the fit of a basic TF."""
    return has_volume(config) and config.tf in config.mesh.tfs and bool(kinds()[config.fit.field].depth)


def is_compared(config: DictConfig) -> bool:
    """Whether this is the first of several recipes: its configuration stands for all of them."""
    if not is_fit(config) or changes(config) or len(config.fits) < 2:
        return False
    return bool(config.fit.name == with_recipe(config, config.fits[0]).fit.name)


def has_scene(config: DictConfig) -> bool:
    """Whether the configuration is of all basic TFs."""
    return is_fit(config) and config.tf is None


def has_page(config: DictConfig) -> bool:
    """Whether the scene or its new look becomes a page: those of sweeps are of interest for their numbers."""
    is_shown = is_fit(config) or methods()[config.edit.method].is_look
    able = "html" in kinds()[config.fit.field].exports
    return bool(config.page.made and config.tf is None and able and is_shown and not changes(config))


def has_gallery(config: DictConfig) -> bool:
    """Whether this is the first of the recipes and variants of an experiment that has scenes to show."""
    variants = list(changes(config))
    shows_all = len(config.edits) > 1 and not variants
    if not has_scene(config) or not (config.gallery.grids or shows_all):
        return False
    first = variants[:1], config.sweep.seeds[:1], config.sweep.edit_seeds[:1]
    if variants and ([config.variant], [config.fit.seed], [config.edit.seed]) != first:
        return False
    return not config.fits or bool(config.fit.name == with_recipe(config, config.fits[0]).fit.name)
