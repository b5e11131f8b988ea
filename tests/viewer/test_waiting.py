"""What a page says while it waits for a frame: always what is on the screen, and what comes."""

import json
import re
import struct

import pytest

from tests.viewer.in_browser import LINK, expect, served, settle


class Gate:
    """A connection that holds frames back: whole ones, or all."""

    def __init__(self, page):
        self.is_open, self.asked = dict.fromkeys((False, True), True), {}  # by `moving`, and by ids
        self.passed, self._held = set(), []
        page.route_web_socket(re.compile("/socket$"), self._connect)

    def open(self, *, moving):
        """Let frames pass, those that were held first."""
        self.is_open[moving] = True
        held, self._held = self._held, []
        for message in held:
            self._pass(message)

    def _connect(self, route):
        self._route, server = route, route.connect_to_server()
        route.on_message(lambda message: (self._note(message), server.send(message)))
        server.on_message(self._pass)

    def _note(self, message):
        values = json.loads(message)
        if values["type"] == "view":
            self.asked[values["id"]] = values

    def _pass(self, message):
        if isinstance(message, bytes):
            (length,) = struct.unpack_from("<I", message)
            number = json.loads(message[4 : 4 + length])["id"]
            if not self.is_open[self.asked[number]["moving"]]:
                self._held.append(message)
                return
            self.passed.add(number)
        self._route.send(message)


@pytest.fixture
def gated(chromium, sphere_file):
    """A page at rest, and the gate between it and its server."""
    with served(sphere_file) as (_, address):
        page = chromium.new_page(viewport={"width": 800, "height": 500})
        gate = Gate(page)
        page.goto(address + LINK)
        settle(page)
        yield page, gate
        page.close()


def test_a_page_names_what_is_on_the_screen_and_says_what_is_being_drawn(gated):
    page, gate = gated
    told, drawing, picture = (page.locator(name) for name in ("#pace", "#drawing", "#picture"))
    line, legend = page.locator("#wipe"), page.locator("#mode-legend")
    expect(told).to_have_text(re.compile(r"^Shaded, \d+ × \d+, \d+ ms$"))
    gate.is_open = dict.fromkeys((False, True), False)
    page.get_by_label("Show", exact=True).select_option("Scene and volume")
    expect(drawing).to_have_text("Drawing: Scene and volume")
    expect(drawing).to_be_visible()
    expect(told, "the picture is that of before").to_have_text(re.compile("^Shaded"))
    expect(line).to_be_hidden()
    expect(legend).to_have_text("")
    gate.open(moving=True)
    expect(told).to_have_text(re.compile("^Scene and volume"))
    expect(line).to_be_visible()
    expect(legend).to_have_text("Drag the line, or move it by arrow keys.")
    expect(drawing, "the whole frame takes its time").to_be_visible()
    expect(picture).to_have_attribute("aria-busy", "true")
    gate.open(moving=False)
    expect(drawing).to_be_hidden()
    expect(picture).to_have_attribute("aria-busy", "false")
    views = list(gate.asked.values())
    assert [each["moving"] for each in views if each["mode"] == "wipe"] == [True, False], "coarse, then whole"


def test_who_turns_does_not_wait_for_a_whole_frame(gated):
    page, gate = gated
    gate.is_open[False] = False
    page.get_by_label("Show", exact=True).select_option("Volume")
    expect(page.locator("#drawing")).to_be_visible()
    whole = max(gate.asked)
    assert not gate.asked[whole]["moving"]
    page.locator("#picture").press("ArrowLeft")
    expect(page.locator("#drawing")).to_be_hidden()
    assert gate.asked[whole + 1]["moving"], "the next view does not wait for the whole one"
    gate.open(moving=False)
    settle(page)
    assert not gate.asked[max(gate.asked)]["moving"]
    expect(page.locator("#drawing")).to_be_hidden()


def test_a_hand_that_pauses_is_not_at_rest(gated):
    page, gate = gated
    box, before = page.locator("#picture").bounding_box(), max(gate.asked)

    def asked():
        page.wait_for_timeout(300)  # for messages on their way
        return [view["moving"] for number, view in gate.asked.items() if number > before]

    page.clock.install(time=0)
    page.clock.pause_at(1000)  # frames take no time
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    for number in (1, 2):
        page.mouse.move(box["x"] + 200 + number, box["y"] + 200)
        while before + number not in gate.passed:
            page.wait_for_timeout(10)
    page.clock.run_for(300)
    assert asked() == [True, True]
    page.mouse.up()
    page.clock.run_for(300)
    assert asked() == [True, True, False]
