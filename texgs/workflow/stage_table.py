"""The stages of the workflow: a row for each, and one for each method of editing."""

from omegaconf import DictConfig

from texgs.edit.method import Method, methods
from texgs.fit.kinds import FitSpec, fit_specs
from texgs.workflow.applies import (
    has_gallery,
    has_mesh,
    has_page,
    has_scene,
    has_volume,
    is_compared,
    is_fit,
    is_fit_of,
)
from texgs.workflow.galleries import gallery_inputs, gallery_settings
from texgs.workflow.inputs import (
    all_models,
    compared_models,
    edit_settings,
    edited_scene,
    fit_label,
    last_phase,
    lens,
    model_of,
    models,
    prepared_volume,
    recipe,
    scene_and_volume,
    scene_settings,
    scenes_before_and_after,
    seeded,
    shown_scene,
    view_set,
    view_settings,
    volume_inputs,
)
from texgs.workflow.locate import basic_tf, tf_names
from texgs.workflow.stage import Stage, for_tf

LAST_PHASES = tuple(kind.phases[-1] for kind in fit_specs().values())  # which need those before
EDITS = tuple(method.stage for method in methods().values())
AFTER_SHADING = ("texture",)  # keys of a recipe that jobs read after a phase
AFTER_SURFELS = ("materials", "first_material", "shading", *AFTER_SHADING)


def edit_stage(method: Method) -> Stage:
    """The stage of a method of editing."""
    return Stage(
        method.stage,
        "texgs.workflow.stages.edit",
        select=edit_settings,
        inputs=edited_scene,
        place="edit",
        needs=("compose", "views"),
        applies=lambda config: config.tf is None and config.edit.method == method.name,
    )


def fit_stage(kind: FitSpec) -> Stage:
    """The stage of a kind of field that is fitted in one phase."""
    return Stage(
        kind.name,
        "texgs.workflow.stages.fit",
        select=lambda config: {**recipe()(config), "keys": config.fit[kind.name]},
        inputs=view_set,
        place="phase",
        needs=("views",),
        applies=is_fit_of(kind.name),
        fits=kind.module,
    )


ROWS = (
    Stage(
        "volume",
        "texgs.workflow.stages.volume",
        select=lambda config: {"volume": {k: v for k, v in config.dataset.volume.items() if k != "obtain"}},
        inputs=volume_inputs,
        place="volume",
        applies=has_volume,
    ),
    Stage(
        "transfer",
        "texgs.workflow.stages.transfer",
        select=lambda config: {key: config.dataset[key] for key in ("title", "tf_values", "basic_tfs")},
        inputs=prepared_volume,
        place="transfer",
        needs=("volume",),
        applies=has_volume,
    ),
    Stage(
        "views",
        "texgs.workflow.stages.views",
        select=lambda config: {
            "tf_values": config.dataset.tf_values,
            "points": basic_tf(config),
            "views": view_settings(config),
        },
        inputs=prepared_volume,
        place="views",
        needs=("volume",),
        applies=has_volume,
    ),
    Stage(
        "sheet",
        "texgs.workflow.stages.sheet",
        select=lambda config: {},
        inputs=view_set,
        place="sheet",
        needs=("views",),
        applies=lambda config: is_fit(config) and config.views.name == "views",  # of those of a sweep none
    ),
    Stage(
        "surfels",
        "texgs.workflow.stages.surfels",
        select=lambda config: {
            **recipe("low_pass", "facing", "material_range", "seeds", later=AFTER_SURFELS)(config),
            "phase": config.fit.surfels,
        },
        inputs=seeded,
        place="phase",
        needs=("volume", "views"),
        applies=is_fit_of("surfels"),
    ),
    Stage(
        "shading",
        "texgs.workflow.stages.shading",
        select=lambda config: {
            **recipe("material_range", "materials", "first_material", later=AFTER_SHADING)(config),
            "phase": config.fit.shading,
        },
        inputs=model_of("surfels"),
        place="phase",
        needs=("surfels", "views"),
        applies=is_fit_of("surfels"),
    ),
    Stage(
        "texture",
        "texgs.workflow.stages.texture",
        select=lambda config: {**recipe()(config), "texture": config.fit.texture},
        inputs=model_of("shading"),
        place="phase",
        needs=("shading", "views"),
        applies=is_fit_of("surfels"),
    ),
    *(fit_stage(kind) for kind in fit_specs().values() if kind.fit is not None),
    Stage(
        "figure",
        "texgs.workflow.stages.figure",
        select=lambda config: {
            "fit": {
                **fit_label(config)["fit"],
                "reduce": config.fit.reduce,
                "surfels_iterations": config.fit.surfels.iterations,
            }
        },
        inputs=models,
        place="figure",
        needs=LAST_PHASES,
        applies=is_fit,
    ),
    Stage(
        "comparison",
        "texgs.workflow.stages.comparison",
        select=lambda config: {"reduce": config.fit.reduce},
        inputs=compared_models,
        place="comparison",
        needs=("views", *LAST_PHASES),
        applies=is_compared,
    ),
    Stage(
        "mesh",
        "texgs.workflow.stages.mesh",
        select=lambda config: {
            **recipe()(config),
            "tf_values": config.dataset.tf_values,
            "points": basic_tf(config),
            "mesh": {name: value for name, value in config.mesh.items() if name != "tfs"},
            "lens": lens(config),
        },
        inputs=lambda config: {**model_of(last_phase(config))(config), **prepared_volume(config)},
        place="mesh",
        needs=("volume", "views", *LAST_PHASES),
        applies=has_mesh,
    ),
    Stage(
        "compose",
        "texgs.workflow.stages.compose",
        select=lambda config: {"image": config.dataset.image, "lens": lens(config), **fit_label(config)},
        inputs=all_models,
        place="compose",
        needs=LAST_PHASES,
        applies=has_scene,
    ),
    Stage(
        "pse",
        "texgs.workflow.stages.pse",
        select=scene_settings,
        inputs=scene_and_volume,
        place="pse",
        needs=("volume", "compose"),
        applies=has_scene,
    ),
    Stage(
        "timing",
        "texgs.workflow.stages.timing",
        select=scene_settings,
        inputs=scene_and_volume,
        place="timing",
        needs=("volume", "compose"),
        applies=has_scene,
    ),
    *map(edit_stage, methods().values()),
    Stage(
        "page",
        "texgs.workflow.stages.page",
        select=lambda config: {
            "look": config.edit.name,
            "look_seed": config.edit.seed,
            "embedded": config.page.embedded,
            **fit_label(config),
        },
        inputs=shown_scene,
        place="page",
        needs=("compose", *EDITS),
        applies=has_page,
    ),
    Stage(
        "gallery",
        "texgs.workflow.stages.gallery",
        select=gallery_settings,
        inputs=gallery_inputs,
        place="gallery",
        needs=("volume", "compose", *EDITS),
        applies=has_gallery,
    ),
    Stage(
        "edit_metrics",
        "texgs.workflow.stages.edit_metrics",
        select=lambda config: {
            **edit_settings(config),
            "compared": config.metric.views,
            "clip": config.metric.clip,
            "views": view_settings(config),
        },
        inputs=scenes_before_and_after,
        place="edit_metrics",
        needs=("compose", "views", *EDITS),
        applies=lambda config: (
            config.tf is None
            and config.edit.method in [method.name for method in methods().values() if method.is_look]
        ),
    ),
)
STAGES = {stage.name: stage for stage in ROWS}


def jobs(config: DictConfig) -> list[tuple[Stage, DictConfig]]:
    """The stages that a configuration goes through, each with its own configuration of one job.

    Raises:
        MissingDataError: if basic TFs are folders of views that are not there.
    """
    names = tf_names(config)
    by_tf = [for_tf(config, name) for name in names] if is_fit(config) else []
    return [
        (stage, each)
        for stage in STAGES.values()
        for each in filter(stage.applies, by_tf if stage.per_tf else [config])
    ]
