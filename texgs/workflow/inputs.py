"""Which files and settings the stages of the workflow read."""

from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import lru_cache
from pathlib import Path
from typing import Any

from omegaconf import DictConfig
from yaml import YAMLError

from texgs.config.check import is_scene_file
from texgs.config.compose import Same, changed, compose
from texgs.config.project import members
from texgs.core.errors import ArgumentError, ConfigError, MissingDataError
from texgs.core.plain_yaml import parse_yaml
from texgs.edit.keys import EditKeys
from texgs.edit.method import NO_METHOD, method_of
from texgs.fit.kinds import fit_specs
from texgs.workflow.locate import source_file, tf_names, views_folder
from texgs.workflow.looks import captions, looks_of
from texgs.workflow.places import edit_folder, folder_of, made
from texgs.workflow.variants import NO_SWEEP, fit_variant


def volume_inputs(config: DictConfig) -> dict[str, Path]:
    """The volume's file, where there is one."""
    path = source_file(config)
    return {} if path is None else {"source": path}


def prepared_volume(config: DictConfig) -> dict[str, Path]:
    """What stage `volume` writes."""
    return {"volume": made("volume", config)}


def view_set(config: DictConfig, tf: str | None = None) -> dict[str, Path]:
    """The views: those that stage `views` renders, or those that the data set consists of."""
    given = views_folder(config, tf)
    return {"views": made("views", config, tf=tf) if given is None else given / "transforms_train.json"}


def seeded(config: DictConfig) -> dict[str, Path]:
    """The views, and the volume where surfels start in its voxels."""
    from_voxels = config.fit.seeds.kind == "voxels" and config.dataset.views_folder is None
    return {**view_set(config), **(prepared_volume(config) if from_voxels else {})}


def model_of(stage: str) -> Callable[[DictConfig], dict[str, Path]]:
    """The model that a stage of the fit writes, and the views."""
    return lambda config: {"model": made("phase", config, stage), **view_set(config)}


def all_models(config: DictConfig) -> dict[str, Path]:
    """The models of all basic TFs after the last phase, by name.

    Raises:
        ConfigError: if one basic TF is chosen.
    """
    if config.tf is not None:
        raise ConfigError(f"tf: a scene has all basic TFs of its data set; leave out tf={config.tf}")
    return {name: made("phase", config, last_phase(config), name) for name in tf_names(config)}


def last_phase(config: DictConfig) -> str:
    """The phase of a fit that makes what scenes are composed of."""
    return str(fit_specs()[config.fit.field].phases[-1])


def scene_and_volume(config: DictConfig) -> dict[str, Path]:
    """The scene with its models, and the prepared volume where there is one."""
    scene = {"scene": made("compose", config), **models_of_scene(config)}
    return scene if config.dataset.views_folder is not None else {**scene, **prepared_volume(config)}


def models_of_scene(config: DictConfig) -> dict[str, Path]:
    """The models that a scene names, as inputs beside it."""
    return {f"model.{name}": path for name, path in all_models(config).items()}


def shown_scene(config: DictConfig) -> dict[str, Path]:
    """The scene of an edit, or the one as fitted, with its models."""
    place = "compose" if config.edit.method == NO_METHOD else "edit"
    return {"scene": made(place, config), **models_of_scene(config)}


def scene_settings(config: DictConfig) -> dict[str, Any]:
    """What stages read that compare a scene with its volume."""
    basic = {} if config.dataset.views_folder is not None else config.dataset.basic_tfs
    return {
        "tf_values": config.dataset.tf_values,
        "basic_tfs": {name: basic[name] for name in tf_names(config) if name in basic},
        "views": view_settings(config),
        **fit_label(config),
    }


def lens(config: DictConfig) -> dict[str, float]:
    """Distance and field of view of the views, which pictures of scenes share."""
    return {"radius": config.views.radius, "fov_y": config.views.fov_y}


def fit_label(config: DictConfig, later: Sequence[str] = ()) -> dict[str, Any]:
    """Which fit this is, and what it runs on. One that variants of a sweep share is of none of them.

    Args:
        config: of a job.
        later: keys of the recipe that only later jobs read.
    """
    variant = fit_variant(config)
    return {
        "fit": {
            "name": config.fit.name,
            "field": config.fit.field,
            "seed": config.fit.seed,
            "sweep": config.sweep.name if variant else NO_SWEEP,
            "variant": variant,
            "device": config.device.name,
            "changed": is_changed(config.fit, later),
        }
    }


def is_changed(fit: DictConfig, later: Sequence[str] = ()) -> bool:
    """Whether a recipe is not that of the file with its name, but for its seed and for some keys."""
    if fit.name not in members("fit"):
        return True
    file = compose((f"fit={fit.name}",)).fit
    if fit is file:
        return False
    return any(fit[key] != file[key] for key in file if key not in ("seed", *later))


def view_settings(config: DictConfig) -> dict[str, Any]:
    """How views are rendered, without the name of their folder."""
    return {name: value for name, value in config.views.items() if name != "name"}


def models(config: DictConfig) -> dict[str, Path]:
    """The models that the phases of the fit write, and the views."""
    phases = fit_specs()[config.fit.field].phases
    return {
        **{name: made("phase", config, name) for name in phases},
        **view_set(config),
    }


def compared_models(config: DictConfig) -> dict[str, Path]:
    """The models of all recipes of the experiment after their last phases, by recipe, and the views."""
    fits = [with_recipe(config, name) for name in config.fits]
    return {
        **{each.fit.name: made("phase", each, last_phase(each)) for each in fits},
        **view_set(config),
    }


def with_recipe(config: DictConfig, name: str) -> DictConfig:
    """The same configuration with the name and field of another recipe: what decides where its models are."""
    return _with_recipe(Same(config), name)


@lru_cache(maxsize=1024)
def _with_recipe(same: Same, name: str) -> DictConfig:
    recipe = compose((f"fit={name}",)).fit
    return changed(same.config, fit=changed(same.config.fit, name=recipe.name, field=recipe.field))


def recipe(*parts: str, later: Sequence[str] = ()) -> Callable[[DictConfig], dict[str, Any]]:
    """What a stage of the fit reads: what holds for all, and its own parts; `later`: parts of later ones."""
    return lambda config: {
        "fit": {**fit_label(config, later)["fit"], **{part: config.fit[part] for part in ("reduce", *parts)}}
    }


def edited_scene(config: DictConfig) -> dict[str, Path]:
    """The scene that an edit starts from with its models, their training views, and a style picture's file.

    Raises:
        ConfigError: if one basic TF is chosen, or the edit starts from itself.
    """
    if config.edit.base == config.edit.name:
        raise ConfigError(f"edit.base: {config.edit.name} starts from itself; choose another base")
    if config.tf is not None:
        raise ConfigError(f"tf: an edit is of a scene, with all basic TFs; leave out tf={config.tf}")
    views = {f"views.{name}": view_set(config, name)["views"] for name in tf_names(config)}
    method = method_of(config.edit)
    scene = scene_before(config)
    models = files_of_scene(scene) if is_scene_file(config.edit.base or "") else models_of_scene(config)
    looks: dict[str, str | None] = {**looks_of(config)} or {"": None}
    files = {
        f"{key}.{name}" if name else key: path
        for name, look in looks.items()
        for key, path in method.files(method.of(config.edit, look)).items()
    }
    return {"scene": scene, **models, **views, **files}


def files_of_scene(scene: Path) -> dict[str, Path]:
    """The files that the file of a scene names, as far as they are there: what else decides what it shows."""
    try:
        named: list[object] = [parse_yaml(scene.read_text(encoding="utf-8"))]
    except (OSError, ValueError, YAMLError, ArgumentError):
        return {}  # the job tells what is wrong with it
    files: dict[str, Path] = {}
    while named:
        table = named.pop()
        for key, value in table.items() if isinstance(table, dict) else ():
            if key in ("file", "texture") and (path := scene.parent / str(value)).is_file():
                files[f"of_scene.{len(files)}"] = path
            named.append(value)
    return files


def scene_before(config: DictConfig) -> Path:
    """The scene.yaml that an edit starts from.

    Raises:
        MissingDataError: if it is a file that is not there.
    """
    base = config.edit.base
    if base is None:
        return made("compose", config)
    if not is_scene_file(base):
        return sibling(config, base)
    if not Path(base).is_file():
        raise MissingDataError(f"edit.base: {base} is not there; name the file of a scene, or another edit")
    return Path(base)


def sibling(config: DictConfig, name: str) -> Path:
    """The scene.yaml that another edit of the same fit writes."""
    return folder_of("edit", config).with_name(edit_folder(config, name)) / made("edit", config).name


def scenes_before_and_after(config: DictConfig) -> dict[str, Path]:
    """The scene as edited and as fitted, what says where its surfaces are, and the views of all basic TFs.

    Where the experiment has several recipes, surfaces are those of its first, for all edits alike.
    """
    first = with_recipe(config, config.fits[0]) if config.fits else config
    scenes = {"scene": made("edit", config), "before": made("compose", config)}
    return {**edited_scene(config), **scenes, "geometry": made("compose", first)}


def edit_settings(config: DictConfig) -> dict[str, Any]:
    """What jobs of edits read: what all edits have, and the keys of this one's method."""
    keys = [*(field.name for field in fields(EditKeys)), config.edit.method]
    edit = {name: config.edit[name] for name in keys} | captions(config)
    given = {"reduce": config.fit.reduce, "lens": lens(config)}
    given["followed"] = looks_of(config)
    label = fit_label(config)["fit"] | {"sweep": config.sweep.name, "variant": config.variant}
    return {"edit": edit, "fit": label, **given}
