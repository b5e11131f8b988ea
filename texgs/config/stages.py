"""The stages of the workflow, and which settings and files each of them reads."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from texgs.config.locate import basic_tf, source_file, tf_names, views_folder
from texgs.config.stage import Stage, for_tf
from texgs.core.errors import ConfigError


def volume_inputs(config: DictConfig) -> dict[str, Path]:
    """The volume's file, where there is one."""
    path = source_file(config)
    return {} if path is None else {"source": path}


def prepared_volume(config: DictConfig) -> dict[str, Path]:
    """What stage `volume` writes."""
    return {"volume": STAGES["volume"].output(config) / "volume.nrrd"}


def view_set(config: DictConfig) -> dict[str, Path]:
    """The views: those that stage `views` renders, or those that the data set consists of."""
    return {"views": (views_folder(config) or STAGES["views"].output(config)) / "transforms_train.json"}


def seeded(config: DictConfig) -> dict[str, Path]:
    """The views, and the volume where surfels start in its voxels."""
    from_voxels = config.fit.seeds.kind == "voxels" and config.dataset.views_folder is None
    return {**view_set(config), **(prepared_volume(config) if from_voxels else {})}


def model_of(stage: str) -> Callable[[DictConfig], dict[str, Path]]:
    """The model that a stage of the fit writes, and the views."""
    return lambda config: {"model": STAGES[stage].output(config) / "model.safetensors", **view_set(config)}


def all_models(config: DictConfig) -> dict[str, Path]:
    """The textured models of all basic TFs, by name.

    Raises:
        ConfigError: if one basic TF is chosen.
    """
    if config.tf is not None:
        raise ConfigError(f"tf: a scene has all basic TFs of its data set; leave out tf={config.tf}")
    return {
        name: STAGES["texture"].output(for_tf(config, name)) / "model.safetensors"
        for name in tf_names(config)
    }


def scene_and_volume(config: DictConfig) -> dict[str, Path]:
    """The scene, and the prepared volume where there is one."""
    scene = {"scene": STAGES["compose"].output(config) / "scene.yaml"}
    return scene if config.dataset.views_folder is not None else {**scene, **prepared_volume(config)}


def scene_settings(config: DictConfig) -> dict[str, Any]:
    """What stages read that compare a scene with its volume."""
    basic = {} if config.dataset.views_folder is not None else config.dataset.basic_tfs
    return {
        "tf_values": config.dataset.tf_values,
        "basic_tfs": {name: basic[name] for name in tf_names(config) if name in basic},
        "views": view_settings(config),
        **fit_label(config),
    }


def fit_label(config: DictConfig) -> dict[str, Any]:
    """Which fit this is, and what it runs on."""
    return {
        "fit": {
            "name": config.fit.name,
            "seed": config.fit.seed,
            "sweep": config.sweep.name,
            "variant": config.variant,
            "device": config.device.name,
        }
    }


def view_settings(config: DictConfig) -> dict[str, Any]:
    """How views are rendered, without the name of their folder."""
    return {name: value for name, value in config.views.items() if name != "name"}


def models(config: DictConfig) -> dict[str, Path]:
    """The models that the three phases of the fit write, and the views."""
    phases = ("surfels", "shading", "texture")
    return {
        **{name: STAGES[name].output(config) / "model.safetensors" for name in phases},
        **view_set(config),
    }


def recipe(*parts: str) -> Callable[[DictConfig], dict[str, Any]]:
    """What a stage of the fit reads: what holds for all of them, and its own parts."""
    return lambda config: {
        "fit": {**fit_label(config)["fit"], **{part: config.fit[part] for part in ("reduce", *parts)}}
    }


STAGES = {
    stage.name: stage
    for stage in (
        Stage(
            "volume",
            "texgs.cli.stages.volume",
            select=lambda config: {
                "volume": {k: v for k, v in config.dataset.volume.items() if k != "obtain"}
            },
            folder="{dataset}/volume",
            inputs=volume_inputs,
        ),
        Stage(
            "transfer",
            "texgs.cli.stages.transfer",
            select=lambda config: {key: config.dataset[key] for key in ("title", "tf_values", "basic_tfs")},
            folder="{dataset}/transfer",
            inputs=prepared_volume,
            needs=("volume",),
        ),
        Stage(
            "views",
            "texgs.cli.stages.views",
            select=lambda config: {
                "tf_values": config.dataset.tf_values,
                "points": basic_tf(config),
                "views": view_settings(config),
            },
            folder="{dataset}/{tf}/{views}",
            inputs=prepared_volume,
            needs=("volume",),
            per_tf=True,
        ),
        Stage(
            "sheet",
            "texgs.cli.stages.sheet",
            select=lambda config: {},
            folder="{dataset}/{tf}/sheet",
            inputs=view_set,
            needs=("views",),
            per_tf=True,
        ),
        Stage(
            "surfels",
            "texgs.cli.stages.surfels",
            select=lambda config: {
                **recipe("low_pass", "facing", "activation", "seeds")(config),
                "phase": config.fit.surfels,
            },
            folder="{dataset}/{tf}/{fit}/surfels",
            inputs=seeded,
            needs=("volume", "views"),
            per_tf=True,
        ),
        Stage(
            "shading",
            "texgs.cli.stages.shading",
            select=lambda config: {
                **recipe("activation", "material", "first_material")(config),
                "phase": config.fit.shading,
            },
            folder="{dataset}/{tf}/{fit}/shading",
            inputs=model_of("surfels"),
            needs=("surfels", "views"),
            per_tf=True,
        ),
        Stage(
            "texture",
            "texgs.cli.stages.texture",
            select=lambda config: {**recipe()(config), "texture": config.fit.texture},
            folder="{dataset}/{tf}/{fit}/texture",
            inputs=model_of("shading"),
            needs=("shading", "views"),
            per_tf=True,
        ),
        Stage(
            "figure",
            "texgs.cli.stages.figure",
            select=lambda config: {
                "fit": {
                    **fit_label(config)["fit"],
                    "reduce": config.fit.reduce,
                    "surfels_iterations": config.fit.surfels.iterations,
                }
            },
            folder="{dataset}/{tf}/{fit}/figure",
            inputs=models,
            needs=("texture",),  # which needs the others
            per_tf=True,
        ),
        Stage(
            "compose",
            "texgs.cli.stages.compose",
            select=lambda config: {"image": config.dataset.image, **fit_label(config)},
            folder="{dataset}/scene/{fit}/compose",
            inputs=all_models,
            needs=("texture",),
        ),
        Stage(
            "pse",
            "texgs.cli.stages.pse",
            select=scene_settings,
            folder="{dataset}/scene/{fit}/pse",
            inputs=scene_and_volume,
            needs=("volume", "compose"),
        ),
        Stage(
            "timing",
            "texgs.cli.stages.timing",
            select=scene_settings,
            folder="{dataset}/scene/{fit}/timing",
            inputs=scene_and_volume,
            needs=("volume", "compose"),
        ),
    )
}
