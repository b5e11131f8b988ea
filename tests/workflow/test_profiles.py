"""Profiles and their page name rules that exist: Snakemake takes other names without a word."""

import re
from itertools import pairwise
from pathlib import Path

import pytest
import yaml

from texgs.config.compose import compose
from texgs.workflow.stage_table import RULES, STAGES

ROOT = Path(__file__).parents[2]
PROFILES = sorted((ROOT / "workflow" / "profiles").glob("*/profile.yaml"))
PAGE = (ROOT / "docs" / "workflow.md").read_text()
BLOCKS = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
BY_RULE = ("set-threads", "set-resources", "groups")
NAMES = {*RULES, "tables", "report"}


def named(settings: dict) -> set[str]:
    """The rules that settings of a profile name."""
    return {rule for key in BY_RULE for rule in settings.get(key, {})}


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.parent.name)
def test_profiles_name_rules_that_exist(path):
    with_suggestions = re.sub(r"^  # ", "  ", path.read_text(), flags=re.MULTILINE)
    assert named(yaml.safe_load(with_suggestions)) <= NAMES


def test_the_page_of_clusters_names_rules_that_exist():
    words = re.findall(rf"--(?:{'|'.join(BY_RULE)}) ((?:\w+[=:]\S+ ?)+)", PAGE)
    in_words = {re.split("[=:]", word)[0] for some in words for word in some.split()}
    in_blocks = set().union(*(named(yaml.safe_load(block)) for block in BLOCKS))
    assert in_words
    assert in_blocks
    assert in_words | in_blocks <= NAMES


def test_every_rule_with_a_gpu_is_in_the_example_of_the_page():
    with_gpu = {rule.name for rule in RULES.values() if rule.gpu}
    [example] = [block for block in BLOCKS if "set-resources" in block]
    shown = yaml.safe_load(example)["set-resources"]
    assert set(shown) == with_gpu
    profile = yaml.safe_load((ROOT / "workflow" / "profiles" / "slurm" / "profile.yaml").read_text())
    lost = [
        rule for rule in shown if not profile["set-resources"].get(rule, {}).items() <= shown[rule].items()
    ]
    assert not lost, "the lines of the page replace those of the profile"


def test_jobs_share_a_submission_only_with_those_that_they_wait_for():
    """Snakemake asks for the time of one of several jobs side by side, and runs them one after another."""
    profile = yaml.safe_load((ROOT / "workflow" / "profiles" / "slurm" / "profile.yaml").read_text())
    assert "group-components" not in profile
    config = compose(("dataset=turbulence", "tf=TF01"))
    whole = compose(("dataset=turbulence",))
    told = re.search(r"\*\*Groups\.\*\*(.*)", PAGE)[1]
    for group in set(profile["groups"].values()):
        rules = [rule for rule in RULES if profile["groups"].get(rule) == group]
        assert " and ".join(f"`{rule}`" for rule in rules) in told, "the page tells which"
        for before, after in pairwise(rules):
            each = config if STAGES[after].per_tf else whole
            read = {path.parent for path in STAGES[after].inputs(each).values()}
            assert STAGES[before].output(each) in read, group
