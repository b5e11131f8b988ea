"""Compose conf/ and overrides into one checked configuration; a mistake is a sentence that names the key.

Hydra, which takes 0.3 s, is loaded with the first one: jobs that read their settings from a file go without.
"""

import os
import re
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from texgs.config.project import MAX_NAME_LETTERS, Words, check_name, folders, is_scene_file
from texgs.config.schema import Config
from texgs.core.errors import ConfigError
from texgs.core.keys import mismatch, typed
from texgs.core.names import close
from texgs.fields.kinds import kinds
from texgs.volume.view_settings import LightKeys

ONE_LIGHT = "-one-light"  # suffix of folders with views for fields that cannot be relit
NAMED_GROUPS = ("dataset", "fit", "edit")  # groups whose file names become names of result folders


def compose(overrides: tuple[str, ...] = (), first: Path | None = None) -> Config:
    """Return the configuration, references resolved.

    Args:
        overrides: words such as ``dataset=engine`` or ``views.width=400``, in Hydra's syntax.
        first: a folder to look for files in before those of the project.

    Raises:
        ConfigError: for an unknown key, group member or value, or one of the wrong type or out of range;
            or a file that cannot be read.
    """
    places = (first, *folders()) if first else folders()
    return _composed(overrides, places, os.environ.get("TEXGS_DATA"))


def recompose(overrides: Words) -> Config:
    """Do as `compose`, but read again files that may have changed since."""
    return _composed.__wrapped__(overrides, folders(), os.environ.get("TEXGS_DATA"))


def preset(group: str, name: str) -> Config:
    """Return the configuration with a single choice from conf/, such as `quick` of the group `fit`."""
    return compose((f"{group}={name}",))


@lru_cache(maxsize=1024)
def _composed(overrides: Words, places: tuple[Path, ...], _data_folder: str | None) -> Config:
    from texgs.config.composition import composition
    from texgs.config.mistakes import texgs_errors

    if not places[-1].is_dir():
        raise ConfigError(f"{places[-1]}: no configuration there; install texgs again")
    with texgs_errors():
        config = typed(Config, composition(overrides, places))
        config = with_lights_of_field(replace(config, sweep=config.sweep.named))
    check_names(config)
    check_basic_tfs(config)
    check_chosen(overrides, config)
    return config


def with_lights_of_field(config: Config) -> Config:
    """Return a configuration whose views have headlights for random lights where its field cannot be relit.

    Such views have a folder of their own, for an experiment may have fits of both kinds.
    """
    views = config.views
    lights = [LightKeys() if light.kind == "random" else light for light in views.lights]
    if lights == views.lights or "relight" in kinds()[config.fit.field].can:
        return config
    return replace(config, views=replace(views, name=views.name + ONE_LIGHT, lights=lights, relit=0))


def check_names(config: Config) -> None:
    """Require names that are valid for folders and that texgs does not use for its own folders."""
    for key in ("fit.name", "edit.name", "gallery.name", "dataset.name", "views.name"):
        group, _, _ = key.partition(".")
        check_name(key, name := getattr(config, group).name)
        if group in ("fit", "edit", "gallery") and re.fullmatch("sheet|comparison|views.*", name):
            raise ConfigError(f"{key}: {name} is a folder of texgs; choose another name")
    if config.edit.base is not None and not is_scene_file(config.edit.base):
        check_name("edit.base", config.edit.base)
    for tf in config.dataset.basic_tfs:
        check_name("dataset.basic_tfs", tf)
    for key, value, pattern, expected in (
        ("views.name", config.views.name, "views(-.*)?", "views or views-..."),
        ("sweep.name", config.sweep.name, r"[A-Za-z0-9_-]*", "letters, digits, _ or -"),
        (
            *("variant", config.variant, rf"([A-Za-z0-9_-][A-Za-z0-9_.-]{{,{MAX_NAME_LETTERS - 1}}})?"),
            f"at most {MAX_NAME_LETTERS} letters, digits, _, - or .",
        ),
    ):
        if not re.fullmatch(pattern, value):
            raise ConfigError(str(mismatch(key, expected, value)))


def check_basic_tfs(config: Config) -> None:
    """Require that the data set has the basic TFs that are named, and a volume if there are meshes."""
    known = list(config.dataset.basic_tfs)
    if config.mesh.tfs and config.dataset.views_folder is not None:
        raise ConfigError(
            f"mesh.tfs: data set {config.dataset.name} starts from views and has no volume to compare with; "
            "leave mesh.tfs empty"
        )
    for key, tfs in (("mesh.tfs", config.mesh.tfs), ("dataset.framed_by", config.dataset.framed_by)):
        for tf in tfs:
            if tf not in known:
                raise ConfigError(f"{key}: expected some of {', '.join(known)}, got {tf}{close(tf, known)}")


def check_chosen(overrides: Words, config: Config) -> None:
    """Require that a chosen file carries its own name; otherwise results would go to another one's folder."""
    for group in NAMED_GROUPS:
        chosen = [word.partition("=")[2].strip("'\"") for word in overrides if word.startswith(f"{group}=")]
        if any(re.match(rf"[+]*{group}\.name=", word) for word in overrides) or not chosen:
            continue
        if (name := getattr(config, group).name) != chosen[-1]:
            raise ConfigError(
                f"{group}={chosen[-1]}: expected `name: {chosen[-1]}` in its file, got {name}; "
                f"change it there, or add {group}.name={name}"
            )
