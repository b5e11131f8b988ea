"""The page of a scene: its bytes, and what it does in a real browser that opens it as a file."""

import base64
import io
import json
import re
import shlex
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from tests.fields.surfels.samples import sample
from tests.fields.surfels.test_composition import ball
from tests.viewer.drawing import rendered
from tests.viewer.in_browser import HIDE, opened_file, settle
from texgs.cli.main import main
from texgs.core.camera import orbit
from texgs.core.cuts import NO_CUTS, Cuts, Plane
from texgs.core.io import write_json
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.part_edit import PartEdit
from texgs.fields.surfels.model_file import write_model
from texgs.report.check import checksum_of
from texgs.scene.scene import Scene, SceneModel, SceneVolume
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer import standalone

HOSTILE = "</script><b>&'\""
LEVELS = 3  # of 255, see test_agreement.py
SIZE = (900, 400)  # of the window; a part of it is the picture


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("scene")


@pytest.fixture(scope="module")
def scene(folder):
    """A scene file of two models, one with a name that is HTML."""
    models = {
        HOSTILE: SceneModel(write_model(folder / "a.safetensors", ball(1)), PartEdit(opacity=0.8)),
        "B": SceneModel(write_model(folder / "b.safetensors", ball(2, n=80, middle=0.2))),
    }
    return write_scene(folder / "scene.yaml", Scene(models, background=(0.9, 0.9, 1.0)))


@pytest.fixture(scope="module")
def file(scene, folder):
    assert main(["export", str(scene), "--to", str(folder / "scene.html")]) == 0
    return folder / "scene.html"


@pytest.fixture
def page(chromium, file):
    with opened_file(chromium, file, link="", size=SIZE) as page:
        yield page


def shown(page):
    """What the canvas shows [H, W, 3]."""
    page.locator("#marks").evaluate(HIDE)
    picture = page.locator("#picture").screenshot(type="png")
    return np.asarray(Image.open(io.BytesIO(picture)).convert("RGB"))


def described(file):
    return json.loads(re.search(r'id="scene">([^<]*)<', file.read_text())[1])


def surfels(file):
    return re.search(r'id="surfels">([^<]*)<', file.read_text())[1]


def expected(file, size, light=HEADLIGHT, edits=None, turned=(0.0, 0.0), cuts=NO_CUTS):
    """What the rasterizer makes of it, from where the page begins and then turned by so many degrees."""
    view = described(file)["views"][0]
    width, height = size
    distance = view["distance"] * max(1, height / width)
    angles = view["azimuth"] + turned[0], view["polar"] + turned[1]
    camera = orbit(*angles, distance, Lens().fov_y, width, height, target=view["target"])
    edits = [PartEdit(opacity=0.8), PartEdit()] if edits is None else edits
    return rendered(surfels(file), camera, light, edits, (0.9, 0.9, 1.0), cuts=cuts)


def differ(page, *rest, **edited):
    """Largest difference of what is shown from what is expected, within the outline of what has the focus."""
    pixels = shown(page)
    height, width = pixels.shape[:2]
    difference = np.abs(pixels.astype(int) - expected(*rest, (width, height), **edited))
    return int(difference[4:-4, 4:-4].max())


def test_the_same_scene_gives_the_same_bytes(scene, file, tmp_path):
    assert main(["export", str(scene), "--to", str(tmp_path / "scene.html")]) == 0
    assert (tmp_path / "scene.html").read_bytes() == file.read_bytes()


def test_names_are_text_and_only_its_own_script_may_run(file):
    text = file.read_text()
    assert HOSTILE not in text
    assert text.count("</script>") == 3
    assert "default-src &#39;none&#39;" in text or "default-src 'none'" in text
    assert "unsafe" not in text.split("<style>")[0]
    assert [model["name"] for model in described(file)["models"]] == [HOSTILE, "B"]


def test_nothing_else_may_run_or_load(chromium, file):
    page = chromium.new_page()
    page.goto(file.as_uri())
    page.evaluate(
        "() => { const script = document.createElement('script');"
        " script.textContent = 'globalThis.ran = true'; document.head.append(script);"
        " document.body.setAttribute('onclick', 'globalThis.ran = true'); }"
    )
    page.locator("h1").click()
    assert page.evaluate("globalThis.ran") is None
    assert page.evaluate("fetch('data:,x').then(() => 'loaded', () => 'refused')") == "refused"
    page.close()


def test_it_tells_what_a_check_has_found(scene, folder, tmp_path):
    told = "At least 30 dB & more"
    write_json(folder / "scene-check.json", {"models": checksum_of(read_scene(scene)), "sentence": told})
    try:
        assert main(["export", str(scene), "--to", str(tmp_path / "checked.html")]) == 0
    finally:
        (folder / "scene-check.json").unlink()
    html = (tmp_path / "checked.html").read_text()
    assert '<meta name="description" content="At least 30 dB &amp; more">' in html
    assert '<p class="hint">At least 30 dB &amp; more</p>' in html


def test_cuts_are_hollow_in_the_page_and_on_its_poster(scene, tmp_path):
    """A page has no volume: neither has its poster, whatever the scene names."""
    opened = replace(read_scene(scene), cuts=Cuts([Plane([1.0, 0.0, 0.0], 0.0)]))
    named = replace(opened, volume=SceneVolume(tmp_path / "gone.nrrd", {}))
    pages = [standalone.write_page(tmp_path / "cut.html", each, "cut") for each in (opened, named)]
    assert pages[0].poster == pages[1].poster
    assert "Cuts are hollow here" in pages[0].text


def test_it_holds_a_picture_of_the_first_view(file):
    poster = re.search(r"data:image/jpeg;base64,([^\"]*)", file.read_text())[1]
    pixels = np.asarray(Image.open(io.BytesIO(base64.b64decode(poster))))
    assert np.abs(pixels.astype(int) - expected(file, pixels.shape[:2])).mean() < 3


def test_it_opens_as_a_file_and_shows_what_the_rasterizer_renders(page, file):
    assert differ(page, file) <= LEVELS


def test_edits_and_lights_show_and_can_be_undone(page, file):
    first, other = page.locator("#models fieldset.part").all()
    assert HOSTILE in first.locator("legend").text_content()
    first.get_by_label(f"Palette of {HOSTILE}", exact=True).fill("#ff2040")
    first.get_by_label(f"Opacity of {HOSTILE}", exact=True).fill("0.5")
    other.get_by_title("Visible").uncheck()
    page.get_by_label("Headlight").uncheck()
    page.get_by_label("Polar of the light, degrees", exact=True).fill("50")
    words = ["light=30,50", f"{HOSTILE}.palette=#ff2040", f"{HOSTILE}.opacity=0.5", "B.visible=false"]
    assert shlex.split(page.locator("#words textarea").input_value()) == words
    titles = page.get_by_role("listitem").all_text_contents()  # the fourth is a light at the camera
    changes = [f"{HOSTILE} palette #ff2040", f"{HOSTILE} opacity 0.5", "B visible off"]
    assert [*titles[:3], titles[4]] == [*changes, "light azimuth 30°, polar 50°"]
    settle(page)
    edits = [PartEdit(palette=(1, 32 / 255, 64 / 255), opacity=0.5), PartEdit(visible=False)]
    assert differ(page, file, light=Light("directional", 30, 50), edits=edits) <= LEVELS
    page.get_by_role("button", name="Compare").click()
    settle(page)
    assert page.locator("#badge").is_visible()
    page.locator("#badge").evaluate("each => { each.style.visibility = 'hidden'; }")
    assert differ(page, file) <= LEVELS
    for _ in range(5):
        page.get_by_role("button", name="Undo").click()
    assert page.get_by_role("button", name="Compare").get_attribute("aria-pressed") == "false"
    settle(page)
    assert page.locator("#words").is_hidden()
    assert differ(page, file) <= LEVELS


def test_a_plane_cuts_the_page_and_words_make_the_same_cut(page, file, scene, folder):
    page.get_by_role("button", name="Add a plane").click()
    page.get_by_role("checkbox", name="Arrows in the picture").uncheck()
    words = shlex.split(page.locator("#words textarea").input_value())
    assert main(["edit", str(scene), *words, "--output", str(folder / "cut.yaml")]) == 0
    cuts = read_scene(folder / "cut.yaml").cuts
    assert len(cuts.planes) == 1
    page.get_by_role("checkbox", name="Box").check()
    page.get_by_label("Faces").select_option("Without light")
    steps = page.get_by_role("list", name="Steps", exact=True).get_by_role("listitem")
    assert steps.all_text_contents() == ["cuts 1 plane", "cuts 1 plane, box", "cuts 1 plane, box, unlit"]
    for _ in range(2):
        page.get_by_role("button", name="Undo").click()
    settle(page)
    assert differ(page, file, cuts=cuts) <= LEVELS
    assert differ(page, file) > 50, "it takes something away"


def test_the_words_at_an_input_are_in_its_name(page):
    page.get_by_role("button", name="Add a plane").click()
    page.get_by_role("checkbox", name="Box").check()
    names = page.locator(".row:has(> .name):has(> [aria-label])").evaluate_all(
        "all => all.map((r) => [r.querySelector('.name').textContent, r.querySelector('input').ariaLabel])"
    )
    assert len(names) > 20
    assert [each for each in names if not each[1].startswith(each[0])] == []


def test_a_number_out_of_range_is_told(page):
    number = page.get_by_label("Opacity of B, as a number")
    number.fill("2000")
    number.press("Tab")
    told = page.get_by_text("Opacity of B: expected a number from 0 to 1000, got 2000.")
    assert told.is_visible()
    assert number.input_value() == "1"


def test_what_a_key_has_moved_can_be_reset_at_once(page):
    opacity = page.get_by_label("Opacity of B", exact=True)
    opacity.press("ArrowLeft")
    reset = page.get_by_role("button", name="Reset opacity of B")
    assert reset.is_enabled()
    reset.click()
    assert opacity.input_value() == "1"


def test_a_key_event_without_a_key_breaks_nothing(page):
    broken = []
    page.on("pageerror", lambda error: broken.append(error))
    page.evaluate("document.dispatchEvent(new Event('keydown', { bubbles: true }))")
    assert broken == []


def test_the_oldest_of_many_steps_stay_made(page):
    visible = page.locator("#models").get_by_title("Visible").last
    visible.evaluate("box => { for (let count = 0; count < 251; count++) box.click(); }")
    steps = page.get_by_role("listitem")
    assert steps.count() == 200
    page.locator("#undo").evaluate("undo => { while (!undo.disabled) undo.click(); }")
    assert visible.is_checked() is False, "the first 51 stay"
    assert page.locator("#steps .undone").count() == 200


def test_pointers_and_keys_turn_the_camera(page, file):
    page.mouse.move(100, 160)
    page.mouse.down()
    page.mouse.move(80, 170)
    page.mouse.up()
    page.locator("#picture").press("ArrowLeft")
    page.locator("#picture").press("ArrowUp")
    settle(page)
    assert differ(page, file, turned=(8 + 5, 4 - 5)) <= LEVELS
    assert "azimuth=43" in page.url
    page.locator("#picture").press("Home")
    settle(page)
    assert differ(page, file) <= LEVELS
    page.get_by_label("From").select_option("From +y")
    page.wait_for_url(re.compile("azimuth=-90&polar=90&"))


def test_a_link_leads_back_to_the_view(page, chromium, file):
    page.locator("#picture").press("ArrowLeft")
    page.get_by_label("Show", exact=True).select_option("normal")
    page.wait_for_url(re.compile("mode=normal"))
    with opened_file(chromium, file, page.url[page.url.index("#") :], size=SIZE) as other:
        page.locator("#picture").evaluate("each => each.blur()")
        assert other.get_by_label("Show", exact=True).input_value() == "normal"
        assert np.abs(shown(other).astype(int) - shown(page))[4:-4, 4:-4].max() <= 1


WRONG = [  # as links to pages that were edited by hand
    {"part": "", "key": "models", "value": None},
    {"part": "", "key": "light", "value": {"azimuth": "<b>", "polar": 0}},
    {"part": "", "key": "background", "value": [2, 0, 0]},
    {"part": "", "key": "cuts", "value": {"planes": 3, "box": None, "faces": "shaded"}},
    {"part": "", "key": "functions", "value": {}},
    {"part": "", "key": "markers", "value": [{"points": [[0, 0]], "text": ""}]},
    {"part": "", "key": "constructor", "value": 1},
    {"part": "B", "key": "opacity", "value": -5},
    {"part": "B", "key": "visible", "value": "no"},
    {"part": "B", "key": "palette", "value": "red"},
    {"part": "B", "key": "segments", "value": []},
    {"part": "C", "key": "opacity", "value": 1},
    {"part": 3},
    None,
]


def test_of_a_wrong_link_is_done_what_can_be_and_the_rest_named(page, file):
    good = {"part": "B", "key": "visible", "value": False}
    words = {
        "azimuth": "<b>",
        "polar": "1e300",
        "target": "1,2",
        "mode": "wipe",
        "edits": json.dumps([*WRONG, good]),
    }
    page.evaluate("words => { location.hash = new URLSearchParams(words); }", words)
    told = page.get_by_text("This page cannot use of the link")
    told.wait_for()
    names = "mode, azimuth, polar, target, models, light, background, cuts, functions, markers, constructor, "
    assert (
        f"{names}B opacity, B visible, B palette, B segments, C opacity, 3, an edit." in told.text_content()
    )
    page.evaluate("() => { document.getElementById('notices').hidden = true; }")
    assert page.get_by_role("listitem").all_text_contents() == ["B visible off"]
    settle(page)
    assert differ(page, file, edits=[PartEdit(opacity=0.8), PartEdit(visible=False)]) <= LEVELS
    page.evaluate("() => { location.hash = 'edits={'; }")
    page.wait_for_function("document.getElementById('notices').textContent.includes('link: edits.')")


def test_the_picture_comes_again_after_the_context_was_lost(page, file):
    before = shown(page)
    lose = "document.getElementById('picture').getContext('webgl2').getExtension('WEBGL_lose_context')"
    page.evaluate(f"() => {{ globalThis.lose = {lose}; lose.loseContext(); }}")
    page.wait_for_function("document.getElementById('notices').textContent.includes('graphics driver')")
    page.evaluate("() => lose.restoreContext()")
    page.wait_for_function("document.getElementById('notices').textContent === ''")
    settle(page)
    assert np.array_equal(shown(page), before)


def test_it_follows_the_size_of_the_window(page, file):
    page.set_viewport_size({"width": 850, "height": 620})
    settle(page)
    page.locator("#picture").press("Home")
    settle(page)
    assert differ(page, file) <= LEVELS


SLOW = """() => { // each frame takes 150 ms
  const card = WebGL2RenderingContext.prototype, { fenceSync, getSyncParameter } = card;
  card.fenceSync = function (...words) {
    return Object.assign(fenceSync.apply(this, words), { begun: performance.now() });
  };
  card.getSyncParameter = function (fence, name) {
    return performance.now() < fence.begun + 150 ? this.UNSIGNALED : getSyncParameter.call(this, fence, name);
  };
}"""
MOVES = """async () => { // as rare as moves of a pointer between slow frames: widths of pictures meanwhile
  const picture = document.getElementById("picture"), widths = [];
  for (let count = 0; count < 20; count++) {
    picture.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
    await new Promise((done) => setTimeout(done, 150));
    widths.push(picture.width);
  }
  return widths;
}"""


def test_slow_frames_of_what_moves_are_coarse_until_it_rests(page, file):
    whole = page.locator("#picture").evaluate("picture => picture.width")
    page.evaluate(SLOW)
    assert set(page.evaluate(MOVES)[10:]) == {-(-whole // 4)}
    settle(page)
    assert page.locator("#picture").evaluate("picture => picture.width") == whole
    assert differ(page, file, turned=(20 * 5, 0)) <= LEVELS


@pytest.mark.parametrize(("is_damaged", "told"), [(False, "has no WebGL2"), (True, "copy the page again")])
def test_a_page_that_cannot_draw_keeps_its_picture_and_says_why(chromium, file, tmp_path, is_damaged, told):
    (copy := tmp_path / "copy.html").write_text(file.read_text())
    page = chromium.new_page()
    if is_damaged:
        text = surfels(file)
        copy.write_text(file.read_text().replace(text, text[: len(text) // 8 * 4]))
    else:
        page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(copy.as_uri())
    page.wait_for_function("told => document.getElementById('notices').textContent.includes(told)", arg=told)
    assert page.locator("#poster").is_visible()
    assert page.locator(":is(button, input, select):enabled").count() == 0
    page.close()


def test_one_model_of_a_scene_keeps_its_edits_and_a_file_is_a_scene(scene, tmp_path):
    assert main(["export", str(scene), "--to", str(tmp_path / "b.html"), "--model", HOSTILE]) == 0
    (model,) = described(tmp_path / "b.html")["models"]
    assert model["name"] == HOSTILE
    assert model["edit"]["opacity"] == 0.8
    assert main(["export", str(scene.with_name("a.safetensors")), "--to", str(tmp_path / "a.html")]) == 0
    assert "<title>a</title>" in (tmp_path / "a.html").read_text()


def test_a_scene_without_surfels_shows_its_background(chromium, tmp_path):
    file = write_model(tmp_path / "none.safetensors", sample(n=0))
    scene = write_scene(tmp_path / "none.yaml", Scene({"A": SceneModel(file)}, background=(0.2, 0.4, 0.6)))
    assert main(["export", str(scene), "--to", str(tmp_path / "none.html")]) == 0
    with opened_file(chromium, tmp_path / "none.html", link="", size=SIZE) as page:
        assert (shown(page)[4:-4, 4:-4] == [51, 102, 153]).all()
