"""Make the pictures of README.md and docs, from runs of texgs and from results under benchmarks.

`python -m tools.pictures NAME...` makes these, without names all of them, and enters them in
benchmarks/results/index.csv. Runs go on in build/pictures where they stopped; TEXGS_DATA names the folder of
the paper's views, without which four pictures cannot be made (those of methods show TF01, when it is alone
there), and VGG-16 and a browser are needed for some.
"""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from PIL import Image

from benchmarks.browser import browser_path
from benchmarks.browser import viewer as view
from benchmarks.labels import volumes
from benchmarks.results import RESULTS, ROOT, add
from texgs.core.camera import orbit
from texgs.core.figures import Cell, Row, as_picture, content, grid_rows, lay_out
from texgs.core.light import Light
from texgs.scene.cut_view import scene_and_volume
from texgs.scene.frame import frame
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin, twin_of
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.label_names import color_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.overlay import overlays
from texgs.volume.render import Appearance
from texgs.volume.slice_picture import SliceKeys, slice_picture
from tools import workflow_picture

DOCS, RUNS = ROOT / "docs", ROOT / "build" / "pictures"
PROGRAM = Path(sys.executable).with_name("texgs")
STYLES = ("strokes", "glass", "marble", "weave", "dots", "waves")
METHODS = (  # of the paper's tables, by short recipes
    "galleries dataset=vortex fit.reduce=2 fits=[quick,gaussians_quick,plenoxels_quick]"
    " edit.looks=true edit.image.lambda_s=1"
)
RUN = {  # words of `texgs run`, by the folder of its results
    "demo": "experiment=demo",
    "fields": "experiment=fields tf=TF04_400 dataset.image=400 fit.reduce=1 comparisons",
    "image": f"{METHODS} edits=[style,style_untextured,stylesplat_quick,arf_quick] gallery.section=image",
    "text": f"{METHODS} edits=[text_quick,text_untextured_quick,in2n_quick,igs2gs_quick,dge_quick]"
    " gallery.section=text",
    "styles": "datasets=[vortex,engine] dataset.vortex.fit.reduce=2 dataset.engine.views.width=400"
    f" dataset.engine.views.height=400 fit=quick edit=style edit.image.style={','.join(STYLES)}"
    " edit.image.recipe=preview,default",
    "engine": "dataset=engine fit=quick scenes",
    "hue": "experiment=hue",
    "mni152": "dataset=mni152 volumes",
}
LOOKS = {  # title: scene file below the scenes of the demo
    "as fitted": "compose/scene.yaml",
    "recoloured": "pse/pse-2.yaml",
    "relit": "pse/relight-5.yaml",
    "stained glass": "edits/glass/scene.yaml",
    "gold": "edits/gold/scene.yaml",
    "painted": "edits/painted/scene.yaml",
    "one lobe in crimson": "edits/crimson/scene.yaml",
}
SHADOWED = Light("directional", -60.0, 60.0, shadows=0.8, occlusion=0.6)  # as docs/scenes.md has it


def shown(
    scene_file: Path, size: int, azimuth: float = 30, polar: float = 20, light: Light | None = None
) -> np.ndarray:
    """Return a scene [size, size, 3], uint8, under its own light, or under another one."""
    scene = read_scene(scene_file)
    if light is not None:
        is_fixed = scene.light.kind == "directional"
        scene = replace(
            scene, light=light.turned(scene.light.azimuth, scene.light.polar) if is_fixed else light
        )
    camera = orbit(azimuth, polar, *scene.framed().lens().square(size))
    return frame(scene.open(), camera, scene, twin=twin_of(scene))


def hero(run: Path) -> Image.Image:
    """Draw six looks of one scene with shadows, a label below each."""
    scenes = run / "orbital/scene/demo"
    pictures = {title: shown(scenes / LOOKS[title], 640, light=SHADOWED) for title in list(LOOKS)[:6]}
    box = content(list(pictures.values()))
    cells = [Cell("", each[box], title) for title, each in pictures.items()]
    return as_picture(lay_out([Row("", cells[:3]), Row("", cells[3:])]))


def looks(run: Path) -> Image.Image:
    """Draw each edit of the demo from two sides."""
    titles = [title for title in LOOKS if title not in ("recoloured", "relit")]
    scenes = [run / "orbital/scene/demo" / LOOKS[title] for title in titles]
    sides = {"front": (30, 20), "from above": (150, 50)}
    rows = {side: [shown(scene, 512, *angles) for scene in scenes] for side, angles in sides.items()}
    return as_picture(lay_out(grid_rows(rows, titles)))


def shadows(run: Path) -> Image.Image:
    """Draw a scene and its volume side by side, without shadows and occlusion, and with both."""
    scene = read_scene(run / "orbital/scene/demo" / LOOKS["as fitted"])
    camera = orbit(30, 20, *scene.framed().lens().square(512))
    composed, twin, pictures = scene.open(), Twin(scene), list[np.ndarray]()
    for light in (SHADOWED.unhidden, SHADOWED):
        pair = scene_and_volume(composed, camera, replace(scene, light=light), twin)
        pictures += [each.color.clamp(0, 1).numpy() for each in pair]
    box, titles = content(pictures), ("scene", "volume", "scene, shadows", "volume, shadows")
    cells = [Cell(title, each[box]) for title, each in zip(titles, pictures, strict=True)]
    return as_picture(lay_out([Row("", cells)]))


def views(run: Path) -> Image.Image:
    """Draw the contact sheets of both basic transfer functions, one below the other."""
    sheets = [Image.open(run / "orbital" / tf / "sheet/sheet.png") for tf in ("TF01", "TF02")]
    both = Image.new("RGB", (max(x.width for x in sheets), sum(x.height for x in sheets)), "white")
    for index, sheet in enumerate(sheets):
        both.paste(sheet, ((both.width - sheet.width) // 2, index * sheets[0].height))
    return both


def styles(run: Path) -> Image.Image:
    """Draw each picture, and two scenes with it laid onto their surfaces and after the edit."""
    rows = {}
    for style in STYLES:
        picture = np.asarray(Image.open(ROOT / f"texgs/models/pictures/{style}.webp").convert("RGB"))
        edits = [f"{name}/scene/quick/edits/style-{style}" for name in ("vortex", "engine")]
        files = [run / f"{edit}-{recipe}/scene.yaml" for edit in edits for recipe in ("preview", "default")]
        rows[style] = [picture, *(shown(file, 512) for file in files)]
    return as_picture(lay_out(grid_rows(rows, ["picture", *(("laid onto it", "edited") * 2)]))).reduce(2)


def slices(run: Path) -> Image.Image:
    """Draw three slices of a head with a crosshair, as `texgs render --slice all` does."""
    grid = open_grid(run / "mni152/volume/volume.nrrd")
    return Image.fromarray(slice_picture(grid, SliceKeys(at=(24, -20, 8), width=1200), {}))


def labels(_: Path) -> Image.Image:
    """Draw labels of the frog, whose numbers are interpolated, then each by its mask."""
    _, frog = volumes(["frog.mhd"])
    camera = orbit(150, 20, *frame_of(frog.masks, frog.of_masks).lens().square(560))
    colors, pictures = [*map(color_of, frog.numbers)], dict[str, np.ndarray]()
    ways = {"numbers, interpolated": (frog.grid, frog.of_numbers), "masks": (frog.masks, frog.of_masks)}
    for title, (grid, white) in ways.items():
        tfs = {str(k): replace(tf, color=((0.0, *colors[k]),)) for k, tf in enumerate(white)}
        rgba = Caster(grid, Appearance()).cast(overlays(tfs), camera, Light("headlight")).rgba
        pictures[title] = (rgba[..., :3] + 1 - rgba[..., 3:]).clamp(0, 1).numpy()
    box = content([*pictures.values()])
    return as_picture(lay_out([Row("", [Cell(title, each[box]) for title, each in pictures.items()])]))


def copy(pattern: str, smaller: int = 1) -> Callable[[Path], Image.Image]:
    """Take a picture that the run itself makes, so many times smaller."""
    return lambda run: Image.open(next(run.glob(pattern))).convert("RGB").reduce(smaller)


def viewer(run: Path) -> Image.Image:
    """Show an edited engine in the viewer, with a new function on its volume, in a hidden browser."""
    from playwright.sync_api import expect, sync_playwright

    scene, edited = run / "engine/scene/quick/compose/scene.yaml", run / "edited.yaml"
    changes = ("TF02.palette=#2a9d8f", "light=-120,35", "shadows=0.8", "occlusion=0.6")
    subprocess.run([PROGRAM, "edit", scene, *changes, "--output", edited], check=True)
    with view(edited) as address, sync_playwright() as player:
        browser = player.chromium.launch(executable_path=browser_path())
        page = browser.new_page(viewport={"width": 1280, "height": 940})
        page.goto(f"{address}#azimuth=-60&polar=20")
        expect(page.locator("#pace")).to_contain_text("ms", timeout=60_000)
        page.get_by_role("button", name="New", exact=True).click()
        page.get_by_label("Opacity of the point").fill("0.1")
        page.get_by_label("Colours of a preset").select_option("Viridis")
        page.wait_for_timeout(10_000)  # until the whole frame is there
        page.locator("#pace").evaluate("pace => pace.hidden = true")  # of this machine, and what else it does
        page.screenshot(path=run / "viewer.png")
    return Image.open(run / "viewer.png")


def tooth(name: str) -> Callable[[Path], Image.Image]:
    """Run the commands of docs/figure.md on a CT of a tooth, and take one of their pictures."""

    def draw(_: Path) -> Image.Image:
        project = RUNS / "figure" / "brain"
        if not project.exists():
            commands = re.findall(
                r"^texgs .*", (DOCS / "figure.md").read_text(encoding="utf-8"), re.MULTILINE
            )
            scan = os.environ["TEXGS_DATA"] + "/tooth.nrrd"
            for _program, *words in [shlex.split(each.replace("../scan.nii.gz", scan)) for each in commands]:
                folder = project if project.exists() else project.parent
                folder.mkdir(parents=True, exist_ok=True)
                subprocess.run([PROGRAM, *words], check=True, cwd=folder)
        picture = Image.open(project / name).convert("RGB")
        return picture.reduce(picture.width // 800)

    return draw


class Picture(NamedTuple):
    """How a picture is made."""

    draw: Callable[[Path], Image.Image]
    source: str  # a run, or a file of results
    code: str = ""  # what its run shows, see benchmarks/results.py


GALLERY = "vortex/gallery/*/gallery.png"
FIT = "volume views surfels shading texture"
PICTURES = {
    "workflow": Picture(workflow_picture.draw, "demo", f"{FIT} compose pse image text segment edit_metrics"),
    "hero": Picture(hero, "demo", f"{FIT} compose pse image text texgs.scene.exposure"),
    "shadows": Picture(shadows, "demo", f"{FIT} compose texgs.scene.exposure"),
    "views": Picture(views, "demo", "volume views sheet"),
    "edits": Picture(copy("orbital/scene/demo/pse/pse.png"), "demo", f"{FIT} pse"),
    "looks": Picture(looks, "demo", f"{FIT} compose image text segment"),
    "fields": Picture(
        copy("vortex/TF04_400/comparison/*/*.png", 2), "fields", f"{FIT} gaussians voxels comparison"
    ),
    "image_methods": Picture(
        copy(GALLERY, smaller=2), "image", f"{FIT} gaussians voxels image stylesplat arf gallery"
    ),
    "text_methods": Picture(
        copy(GALLERY, smaller=2), "text", f"{FIT} gaussians voxels text in2n igs2gs dge gallery"
    ),
    "styles": Picture(styles, "styles", f"{FIT} image"),
    "hues": Picture(copy("orbital/gallery/hue/hue.png", smaller=2), "hue", f"{FIT} image gallery"),
    "slices": Picture(slices, "mni152", "volume texgs.volume.slice_picture"),
    "labels": Picture(labels, "2026-11-30-labels.csv"),
    "figure_functions": Picture(tooth("results/scan/transfer/transfer.png"), "", "volume transfer"),
    "figure_fitted": Picture(tooth("results/scan/scene/quick/compose/scene.png"), "", f"{FIT} compose"),
    "figure_edited": Picture(tooth("figure.png"), "", f"{FIT} compose texgs.scene.exposure"),
    "viewer": Picture(viewer, "engine", f"{FIT} compose texgs.viewer.server"),
}


def small(picture: Image.Image) -> Image.Image:
    """Return it with values rounded to multiples of 4, which halves the file."""
    pixels = np.asarray(picture.convert("RGB")).astype(int)
    return Image.fromarray(((pixels + 2) // 4 * 4).clip(0, 255).astype(np.uint8))


def make(name: str) -> None:
    """Run what a picture shows, unless that is there; draw, write and enter it."""
    picture, path = PICTURES[name], DOCS / f"{name}.png"
    source = RESULTS / picture.source
    if run := RUN.get(picture.source):
        source = RUNS / picture.source
        subprocess.run([PROGRAM, "run", *shlex.split(run), f"results={source}", "tracking=none"], check=True)
    small(picture.draw(source)).save(path, optimize=True)
    add(path, f"python -m tools.pictures {name}", picture.code or picture.source)
    print(f"{path}: {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    if unknown := set(sys.argv[1:]) - PICTURES.keys():
        sys.exit(f"{', '.join(sorted(unknown))}: expected names of {', '.join(PICTURES)}")
    for each in sys.argv[1:] or PICTURES:
        make(each)
