"""The stages of the workflow: a row for each."""

from texgs.config.inputs import (
    all_models,
    edit_settings,
    edited_scene,
    fit_label,
    model_of,
    models,
    prepared_volume,
    recipe,
    scene_and_volume,
    scene_settings,
    scenes_before_and_after,
    seeded,
    view_set,
    view_settings,
    volume_inputs,
)
from texgs.config.locate import basic_tf
from texgs.config.stage import Stage

STAGES = {
    stage.name: stage
    for stage in (
        Stage(
            "volume",
            "texgs.cli.stages.volume",
            select=lambda config: {
                "volume": {k: v for k, v in config.dataset.volume.items() if k != "obtain"}
            },
            inputs=volume_inputs,
        ),
        Stage(
            "transfer",
            "texgs.cli.stages.transfer",
            select=lambda config: {key: config.dataset[key] for key in ("title", "tf_values", "basic_tfs")},
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
            inputs=prepared_volume,
            needs=("volume",),
            per_tf=True,
        ),
        Stage(
            "sheet",
            "texgs.cli.stages.sheet",
            select=lambda config: {},
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
            inputs=model_of("surfels"),
            needs=("surfels", "views"),
            per_tf=True,
        ),
        Stage(
            "texture",
            "texgs.cli.stages.texture",
            select=lambda config: {**recipe()(config), "texture": config.fit.texture},
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
            inputs=models,
            needs=("texture",),  # which needs the others
            per_tf=True,
        ),
        Stage(
            "compose",
            "texgs.cli.stages.compose",
            select=lambda config: {"image": config.dataset.image, **fit_label(config)},
            inputs=all_models,
            needs=("texture",),
        ),
        Stage(
            "pse",
            "texgs.cli.stages.pse",
            select=scene_settings,
            inputs=scene_and_volume,
            needs=("volume", "compose"),
        ),
        Stage(
            "timing",
            "texgs.cli.stages.timing",
            select=scene_settings,
            inputs=scene_and_volume,
            needs=("volume", "compose"),
        ),
        *(
            Stage(
                name,
                f"texgs.cli.stages.{name}",
                select=edit_settings(part),
                inputs=edited_scene,
                needs=("compose", "views"),
            )
            for name, part in (("edit_image", "image"), ("edit_text", "text"), ("edit_segment", "segment"))
        ),
        Stage(
            "edit_metrics",
            "texgs.cli.stages.edit_metrics",
            select=lambda config: {
                **edit_settings("image")(config),
                "compared": config.metric.views,
                "views": view_settings(config),
            },
            inputs=scenes_before_and_after,
            needs=("compose", "views", "edit_image", "edit_text"),
        ),
    )
}
