"""What several stages read, files and settings, and which configurations go through them."""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from texgs.config.compose import preset
from texgs.config.project import is_scene_file, members
from texgs.config.schema import NO_SWEEP, Config
from texgs.core.errors import ConfigError, MissingDataError
from texgs.edit.method import NO_METHOD
from texgs.fitting.kinds import fit_specs
from texgs.workflow.locate import require_volume, tf_names, views_folder
from texgs.workflow.stage import edit_folder, folder_of, plain_values, result_file
from texgs.workflow.sweep import fit_variant, variant_words

MODEL = "model."  # before the names of models among inputs


def is_fit(config: Config) -> bool:
    """Return whether a configuration is of views and fits, not of an edit."""
    return config.edit.method == NO_METHOD


def is_fit_of(kind: str) -> Callable[[Config], bool]:
    """Return whether a configuration is of fits of a kind of field, as a function."""
    return lambda config: is_fit(config) and config.fit.field == kind


def has_volume(config: Config) -> bool:
    """Return whether the data set starts from a volume, not from views."""
    return is_fit(config) and config.dataset.views_folder is None


def has_scene(config: Config) -> bool:
    """Return whether the configuration is of all basic TFs."""
    return is_fit(config) and config.tf is None


def is_series(config: Config) -> bool:
    """Return whether scenes have all steps of a series in time: those of surfels, but for sweeps."""
    has_steps = bool(config.dataset.series) or config.dataset.volume.steps > 1
    return has_steps and config.fit.field == "surfels" and not is_swept(config)


def is_swept(config: Config) -> bool:
    """Return whether the configuration is of a sweep."""
    return bool(variant_words(config))


def is_first_recipe(config: Config) -> bool:
    """Return whether the fit is the first one of the experiment's, whose configuration stands for all."""
    return not config.fits or config.fit.name == with_recipe(config, config.fits[0]).fit.name


def prepared_volume(config: Config) -> dict[str, Path]:
    """Return what stage `volume` writes."""
    require_volume(config.dataset)
    return {"volume": result_file("volume", config)}


def view_set(config: Config, tf: str | None = None) -> dict[str, Path]:
    """Return the views: those that stage `views` renders, or those that the data set consists of."""
    given = views_folder(config, tf)
    return {
        "views": result_file("views", config, tf=tf) if given is None else given / "transforms_train.json"
    }


def start_of_fit(config: Config) -> dict[str, Path]:
    """Return what a fit starts from: the views, and the volume where seeds may come from it."""
    fit = config.fit
    keys = fit if fit_specs()[fit.field].settings is None else getattr(fit, fit.field)
    seeds = getattr(keys, "seeds", None)
    from_volume = seeds and seeds.kind in ("auto", "volume") and config.dataset.views_folder is None
    return {**view_set(config), **(prepared_volume(config) if from_volume else {})}


def model_of(stage: str) -> Callable[[Config], dict[str, Path]]:
    """Return the model that a stage of the fit writes, and the views, as a function."""
    return lambda config: {"model": result_file("phase", config, stage), **view_set(config)}


def start_of_shading(config: Config) -> dict[str, Path]:
    """Return what the shading phase starts from: the model, the views, and the volume if they are of one."""
    from_volume = config.fit.attributes == "auto" and config.dataset.views_folder is None
    return {**model_of("surfels")(config), **(prepared_volume(config) if from_volume else {})}


def last_phase(config: Config) -> str:
    """Return the phase of a fit that makes what scenes are composed of."""
    return fit_specs()[config.fit.field].phases[-1]


def models_of_scene(config: Config) -> dict[str, Path]:
    """Return the models of all basic TFs after the last phase, which a scene names."""
    if config.tf is not None:
        raise ConfigError(f"tf: a scene has all basic TFs of its data set; leave out tf={config.tf}")
    phase = last_phase(config)
    return {f"{MODEL}{name}": result_file("phase", config, phase, name) for name in tf_names(config)}


def models_and_volume(config: Config) -> dict[str, Path]:
    """Return the models that a scene names, and the prepared volume where there is one."""
    models = models_of_scene(config)
    return models if config.dataset.views_folder is not None else {**models, **prepared_volume(config)}


def fitted_scene(config: Config) -> Path:
    """Return the scene.yaml before any edit, of all steps where the data set is a series."""
    return result_file("steps" if is_series(config) else "compose", config)


def scene_and_volume(config: Config) -> dict[str, Path]:
    """Return the scene with all that it names."""
    return {"scene": result_file("compose", config), **models_and_volume(config)}


def scene_before(config: Config) -> Path:
    """Return the scene.yaml that an edit starts from."""
    base = config.edit.base
    if base is None:
        return fitted_scene(config)
    if not is_scene_file(base):
        return sibling(config, base)
    if not Path(base).is_file():
        raise MissingDataError(f"edit.base: {base} is not there; name the file of a scene, or another edit")
    return Path(base)


def sibling(config: Config, name: str) -> Path:
    """Return the scene.yaml that another edit of the same fit writes."""
    return folder_of("edit", config).with_name(edit_folder(config, name)) / result_file("edit", config).name


def shown_tfs(config: Config) -> dict[str, Any]:
    """Return the basic TFs that scenes are compared with; none where there is no volume."""
    basic = {} if config.dataset.views_folder is not None else config.dataset.basic_tfs
    return {name: basic[name] for name in tf_names(config) if name in basic}


def sweep_of_fit(config: Config) -> str:
    """Return the sweep that the fit is of."""
    return config.sweep.name if fit_variant(config) else NO_SWEEP


def is_changed(fit: Any, later: Sequence[str] = ()) -> bool:
    """Return whether a recipe is not that of the file with its name.

    Its seed does not count, nor do the keys of other kinds of field.

    Args:
        fit: recipe of a job.
        later: keys of it that only later jobs read.
    """
    if fit.name not in members("fit"):
        return True
    file, ignored = preset("fit", fit.name).fit, {"seed", *later, *fit_specs()} - {fit.field}
    names = (key.name for key in fields(file) if key.name not in ignored)
    return any(getattr(fit, name) != getattr(file, name) for name in names)


def view_settings(config: Config) -> dict[str, Any]:
    """Return how views are rendered, without the name of their folder."""
    return without(config.views, "name")


def without(table: Any, *names: str) -> dict[str, Any]:
    """Return a table of the configuration without some of its keys."""
    return {name: value for name, value in plain_values(table).items() if name not in names}


def with_recipe(config: Config, name: str) -> Config:
    """Return the configuration with another recipe's name and field: what decides where its models are."""
    recipe = preset("fit", name).fit
    return replace(config, fit=replace(config.fit, name=recipe.name, field=recipe.field))
