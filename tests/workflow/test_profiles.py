"""Profiles and their page name rules that exist: Snakemake takes other names without a word."""

import re
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).parents[2]
RULES = {
    name
    for path in (ROOT / "workflow" / "rules").glob("*.smk")
    for name in re.findall(r"^rule (\w+):", path.read_text(), flags=re.MULTILINE)
}
PROFILES = sorted((ROOT / "workflow" / "profiles").glob("*/profile.yaml"))
PAGE = (ROOT / "docs" / "workflow.md").read_text()
BY_RULE = ("set-threads", "set-resources", "groups")


def named(settings: dict) -> set[str]:
    """The rules that settings of a profile name."""
    return {rule for key in BY_RULE for rule in settings.get(key, {})}


@pytest.mark.parametrize("path", PROFILES, ids=lambda path: path.parent.name)
def test_profiles_name_rules_that_exist(path):
    with_suggestions = re.sub(r"^  # ", "  ", path.read_text(), flags=re.MULTILINE)
    assert named(yaml.safe_load(with_suggestions)) <= RULES


def test_the_page_of_clusters_names_rules_that_exist():
    blocks = re.findall(r"```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    words = re.findall(rf"--(?:{'|'.join(BY_RULE)}) ((?:\w+[=:]\S+ ?)+)", PAGE)
    in_words = {re.split("[=:]", word)[0] for some in words for word in some.split()}
    in_blocks = set().union(*(named(yaml.safe_load(block)) for block in blocks))
    assert in_words
    assert in_blocks
    assert in_words | in_blocks <= RULES


def test_every_rule_with_a_gpu_is_in_the_example_of_the_page():
    rules = "\n".join(path.read_text() for path in (ROOT / "workflow" / "rules").glob("*.smk"))
    bodies = re.split(r"^rule (\w+):", rules, flags=re.MULTILINE)[1:]
    with_gpu = {name for name, body in zip(bodies[::2], bodies[1::2], strict=True) if "gpu=" in body}
    example = re.search(r"name it for these rules:\n\n```yaml\n(.*?)```", PAGE, flags=re.DOTALL)
    assert set(yaml.safe_load(example[1])["set-resources"]) == with_gpu
