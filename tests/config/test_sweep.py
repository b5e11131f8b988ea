import pytest

from texgs.config.compose import compose
from texgs.config.places import fit_folder
from texgs.config.project import members
from texgs.config.stages import STAGES
from texgs.config.sweep import variants
from texgs.core.errors import ConfigError


def test_without_a_sweep_there_are_the_given_words():
    words = ("dataset=sphere", "fit.seed=3")
    assert variants(words) == [words]
    assert fit_folder(compose(words)) == "default-s3"


def test_every_sweep_of_conf_composes():
    for name in members("sweep"):
        found = [compose(words) for words in variants((f"sweep={name}", "dataset=engine", "tf=TF01"))]
        assert len({(fit_folder(each)) for each in found}) == len(found)
        assert all(each.sweep.name == name for each in found)


def words_of(**changes):
    """Words that make a sweep of these variants."""
    quoted = {name: ", ".join(f"'{word}'" for word in words) for name, words in changes.items()}
    return tuple(f"+sweep.variants.{name}=[{words}]" for name, words in quoted.items())


def test_a_variant_has_its_overrides_its_seed_and_a_folder_of_its_own():
    words = ("tf=TF01", "sweep.seeds=[0, 5]", *words_of(a=["fit.low_pass=3"], b=[]))
    found = [compose(each) for each in variants(words)]
    assert [(each.fit.low_pass, each.fit.seed) for each in found] == [(3, 0), (3, 5), (6, 0), (6, 5)]
    assert [fit_folder(each) for each in found] == ["default-a", "default-a-s5", "default-b", "default-b-s5"]
    assert STAGES["shading"].settings(found[0])["fit"]["variant"] == "a"


def test_views_of_a_variant_are_its_own_unless_it_names_them():
    changes = {"a": ["views.width=10"], "b": ["views=paper", "views.name=views-c"], "d": []}
    words = ("dataset=engine", "tf=TF01", *words_of(**changes))
    found = [compose(each) for each in variants(words)]
    folders = [STAGES["views"].output(each).name for each in found]
    assert folders == ["views-a", "views-c", "views"]
    assert [STAGES["sheet"].applies(each) for each in found] == [False, False, True]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((*words_of(a=[]), "sweep.seeds=[]"), "sweep.seeds: expected at least one, got none"),
        (words_of(a=["dataset=sphere"]), "sweep.variants.a: expected overrides of views, fit or device"),
        (words_of(a=["fit.low=1"]), "fit.low: no such key"),
        (("variant=a/b",), "variant: expected letters, digits, _ or -, got 'a/b'"),
    ],
)
def test_a_mistake_in_a_sweep_is_one_sentence(words, message):
    with pytest.raises(ConfigError) as error:
        [compose(each) for each in variants(words)]
    assert message in str(error.value)
