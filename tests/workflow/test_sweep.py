import re
from dataclasses import replace

import pytest

from tests.refusals import refused
from texgs.config.case import Case
from texgs.config.compose import compose
from texgs.config.project import members
from texgs.core.errors import ConfigError
from texgs.workflow.inputs import scene_before
from texgs.workflow.stage import edit_folder, fit_folder
from texgs.workflow.stage_table import STAGES
from texgs.workflow.sweep import as_sweep, swept_values, variants

SEEDS = "expected seeds of a sweep in sweep.seeds"
OVERRIDES = "expected overrides of views, fit, device or edit"
OTHER_KEYS = "expected to change edit gold, whose keys are edit.text, got edit.image.lambda_s"


@pytest.mark.parametrize("name", [name for name in members("sweep") if name != "none"])
def test_every_sweep_of_conf_composes(name):
    configs = [each.config for each in variants_of((f"sweep={name}", "dataset=engine", "tf=TF01"))]
    edits = {edit_folder(each, "any") for each in configs}
    assert len(configs) > 1
    assert len({fit_folder(each) for each in configs}) * len(edits) == len(configs)
    assert all(each.sweep.name == name for each in configs)


def variants_of(words):
    return variants(Case(tuple(words)))


def words_of(**changes):
    """Words that make a sweep of these variants."""
    quoted = {name: ", ".join(f"'{word}'" for word in words) for name, words in changes.items()}
    return ("sweep.name=mine", *(f"+sweep.variants.{name}=[{words}]" for name, words in quoted.items()))


def folders(words):
    """Folders of the fits and edits of a sweep, each once, in their order."""
    configs = [each.config for each in variants_of(words)]
    return list(dict.fromkeys(f"{fit_folder(each)}/{edit_folder(each, 'style')}" for each in configs))


def test_a_variant_has_its_overrides_its_seed_and_a_folder_of_its_own():
    words = ("tf=TF01", "sweep.seeds=[0, 5]", *words_of(a=["fit.low_pass=3"], b=[]))
    configs = [each.config for each in variants_of(words)]
    assert [(each.fit.low_pass, each.fit.seed) for each in configs] == [(3, 0), (3, 5), (6, 0), (6, 5)]
    assert [fit_folder(each) for each in configs] == [f"default-{x}" for x in ("a", "a-s5", "b", "b-s5")]
    assert STAGES["shading"].settings(configs[0])["fit"]["variant"] == "a"


def test_views_of_a_variant_are_its_own_unless_it_names_them():
    changes = {"a": ["views.width=10"], "b": ["views=paper", "views.name=views-c"], "d": []}
    words = ("dataset=engine", "tf=TF01", *words_of(**changes))
    configs = [each.config for each in variants_of(words)]
    folders = [STAGES["views"].output(each).name for each in configs]
    assert folders == ["views-a", "views-c", "views"]
    assert [STAGES["sheet"].applies(each) for each in configs] == [False, False, True]


def test_variants_that_change_edits_alone_share_the_fits():
    words = ("edit=style", *words_of(a=["edit.image.lambda_s=0.5"], b=[]), "sweep.edit_seeds=[0,1]")
    assert folders(words) == [f"default/style-{each}" for each in ("a", "a-s1", "b", "b-s1")]
    first, *_ = [each.config for each in variants_of(words)]
    assert STAGES["texture"].settings(replace(first, tf="TF01"))["fit"]["sweep"] == "none"
    assert (
        STAGES["edit_image"].settings(first)["fit"] | {"sweep": "mine", "variant": "a"}
        == (STAGES["edit_image"].settings(first)["fit"])
    )
    assert STAGES["edit_image"].inputs(first)["scene"].parts[-3:-1] == ("default", "compose")


def test_an_edit_starts_from_the_same_variant_of_another():
    words = ("edit=crimson", *words_of(a=["edit.text.size=64"]), "sweep.edit_seeds=[2]")
    (config,) = [each.config for each in variants_of(words)]
    assert scene_before(config).parts[-2] == "lobe-a-s2"


@pytest.mark.parametrize(
    ("words", "expected"), [((), ["style"]), (("edit=glass",), []), (("edits=[glass]",), ["glass"])]
)
def test_edits_of_a_sweep_stand_in_where_the_experiment_has_none(words, expected):
    assert variants_of(("sweep=lambda_s", *words))[0].config.edits == expected


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("fit.low_pass=2",), ["default/style"]),
        ((*words_of(a=[], b=["fit.low_pass=2"]),), ["default-a/style", "default-b/style"]),
        (("fit.seed=0,1,2",), ["default-seeds/style", "default-seeds-s1/style", "default-seeds-s2/style"]),
        (("edit.seed=range(2)",), ["default/style-seeds", "default/style-seeds-s1"]),
        (("fit.texture.texels=1e5,1e6",), ["default-100000/style", "default-1000000/style"]),
        (
            ("fit.low_pass=2,6", "edit.image.lambda_s=0,1"),
            [f"default-{fit}/style-{fit}-{share}" for fit in (2, 6) for share in (0, 1)],
        ),
        (
            ("fit.texture.has_offset=true,false", "fit.seed=3,4"),
            [f"default-{name}/style" for name in ("true-s3", "true-s4", "false-s3", "false-s4")],
        ),
        (("edit.image.style='a b','c, d'",), ["default/style-a-b", "default/style-c-d"]),
        (("sweep=views", "fit.seed=0,1"), ["default-42/style", "default-42-s1/style", "default-92/style"]),
    ],
)
def test_keys_with_several_values_are_a_sweep(words, expected):
    assert folders(as_sweep(("dataset=engine", "edit=style", *words)))[: len(expected)] == expected


def test_views_are_shared_by_variants_that_differ_in_other_keys():
    words = as_sweep(("dataset=engine", "views.width=16,32", "fit.low_pass=2,6"))
    assert [each.config.views.name for each in variants_of(words)] == ["views-16"] * 2 + ["views-32"] * 2


def test_a_sweep_is_named_after_its_keys_and_other_words_stay():
    words = as_sweep(("fit.low_pass=2,6", "edits=[glass,gold]", "edit.text.instruction='make it a, b'"))
    config = compose(words)
    assert (config.sweep.name, config.edits) == ("low_pass", ["glass", "gold"])
    assert config.edit.text.instruction == "make it a, b"


def test_swept_values_are_told_in_full():
    words = as_sweep(("views.train.frequency=2,3", "fit.seed=0,1", "dataset=engine"))
    assert swept_values(variants_of(words)[1].config) == {"views.train.frequency": "2", "fit.seed": "1"}
    assert swept_values(compose(("fit.seed=3",))) == {}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*words_of(a=[]), "sweep.seeds=[]"), "sweep.seeds: expected at least one, got none"),
        ((*words_of(a=[]), "sweep.edit_seeds=[1,1]"), "sweep.edit_seeds: expected different seeds, got 1"),
        ((*words_of(a=[]), "fit.seed=3"), f"fit.seed: {SEEDS}, got fit.seed=3"),
        (words_of(a=["dataset=sphere"]), "a: got dataset=sphere, whose values go to datasets=[...]"),
        (("results=x,y",), f"sweep.variants.x: {OVERRIDES}, got results=x"),
        (words_of(a=["fit.seed=1"]), "sweep.variants.a: got fit.seed=1, whose values go to sweep.seeds"),
        (("edit=gold,glass",), "sweep.variants.gold: got edit=gold, whose values go to edits=[...]"),
        (("fit.low=1,2",), "fit.low: no such key"),
        (("fit.low_pass=2,2",), "sweep.over: expected different variants, got 2 twice"),
        (("fit.low_pass=interval(0,1)",), "fit.low_pass=interval(0,1): expected several values, such as"),
        (("sweep.name=x", "sweep.over=[fit.low_pass]"), "fit.low_pass: expected several values, such as"),
        (("fit.low_pass=2,6", "sweep=views"), "fit.low_pass=2,6: sweep=views has variants of its own"),
        ((*words_of(a=[]), "sweep.over=['fit.low_pass=2,6']"), "sweep.over: expected none beside"),
        (("sweep.name=x",), "sweep x: expected variants, keys to sweep over or several seeds, got none"),
        (("+sweep.variants.a=[]",), "sweep.name: expected a name for the table of the variants, got none"),
        (
            ("edit.image.lambda_s=0,1",),
            "sweep image_lambda_s: expected an edit that its variants change, got none",
        ),
        (("edit.image.lambda_s=0,1", "edits=[style,gold]"), f"sweep image_lambda_s: {OTHER_KEYS}"),
        (("variant=a/b",), "variant: expected at most 100 letters, digits, _, - or ., got 'a/b'"),
    ],
)
def test_a_mistake_in_a_sweep_is_one_sentence(words, message):
    refused(lambda: [each.config for each in variants_of(as_sweep(words))], re.escape(message), ConfigError)


@pytest.mark.parametrize(
    ("word", "example"),
    [
        ("dataset.volume.dims=4,5,6", ", as in 'dataset.volume.dims=[4,5,6]'"),
        ("fit.seed=range(3)", ""),
    ],
)
def test_a_verb_of_one_stage_names_lists_and_the_verb_that_sweeps(word, example):
    words = f"{word}: expected one value, .* in brackets{example}, .* there is texgs run {word}"
    refused(lambda: compose((word,)), re.sub(r"([\[\]()])", r"\\\1", words), ConfigError)


def test_kinds_of_views_are_not_the_papers_sweep_over_their_number():
    assert "sweep.name=kinds_of_views" in as_sweep(("dataset=sphere", "views=small,headlight"))
    assert "sweep.name=train_frequency" in as_sweep(("dataset=sphere", "views.train.frequency=2,3"))
