"""The page in a real browser: Debian's Chromium through Playwright.

Screenshots of every step lie in the folder that STRIDOR_SCREENSHOTS names (build/screenshots): look at them.
"""

from __future__ import annotations

import json
import os
import signal
import time
import urllib.error
import urllib.request
from pathlib import Path
from typing import Any

import pytest
from browsing import PATIENT, READY, SOLVED, WITH_BROWSER, expect, number, page_at, serving, shot, slide, wait
from page_programs import HUGE_CASE

import stridor as st
from program import stridor
from stridor.case import template_text

pytest.importorskip("nicegui", reason="the extra app is not installed")
pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = WITH_BROWSER


def test_a_slider_moves_the_onset_to_what_the_package_gives(page: Any):
    case = st.loads(template_text("two-beams"))
    assert page.evaluate("stridor.state.onsets.first.mu") == st.onsets(case).first.mu
    slider = page.locator('input[type=range][data-path="bodies.beam1.angle_deg"]')
    slider.focus()
    before = page.evaluate("stridor.state.onsets.first.mu")
    for _ in range(4):
        slider.press("ArrowLeft")
    wait(page, f"{SOLVED} && stridor.state.onsets.first.mu !== {before}")
    angle = float(page.locator('[data-number="bodies.beam1.angle_deg"]').input_value())
    assert angle == pytest.approx(85.0 - 4 * 60 / 200)
    wanted = st.onsets(case.with_({"bodies.beam1.angle_deg": angle}))
    assert page.evaluate("stridor.state.onsets.onsets.map((o) => [o.mu, o.frequency_hz])") == [[o.mu, o.frequency_hz] for o in wanted]
    marks = "getElement(stridor.state.charts.frequency).chart.getOption().series.find((s) => s.id === 'onsets').data.map((d) => d.value)"
    wait(page, f"JSON.stringify({marks}) === JSON.stringify({[[o.mu, o.frequency_hz] for o in wanted if o.mu <= 1]})")
    expect(page.locator("#st-said")).to_contain_text(f"μ = {wanted.first.mu:.5g}"[:10])
    shot(page, "bench")


def test_the_line_of_friction_is_dragged_and_moved_by_keys(page: Any):
    line = page.locator('[data-line="frequency"]')
    box = line.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + 60)
    page.mouse.down()
    page.mouse.move(box["x"] + 200, box["y"] + 60, steps=4)
    page.mouse.up()
    mu = page.evaluate("stridor.state.values.mu")
    assert mu > 0.2
    wait(page, f"stridor.state.at.mu === {mu} && stridor.state.at.checked")
    number(page, "mu", mu)
    line.focus()
    line.press("ArrowRight")
    wait(page, f"stridor.state.at.mu > {mu}")
    expect(line).to_have_attribute("aria-valuetext", f"μ = {page.evaluate('stridor.state.values.mu'):.7g}")


def test_a_mode_is_chosen_by_keyboard_and_played(page: Any):
    page.locator(".st-grows button").first.focus()
    page.keyboard.press("Enter")
    wait(page, "document.querySelector('#st-tornado table') !== null")
    frame = page.frame_locator("#st-mode-frame")
    degrees = frame.locator("#degrees")
    first = degrees.inner_text()
    for _ in range(100):
        if degrees.inner_text() != first:
            break
        time.sleep(0.05)
    else:
        pytest.fail("it does not move")
    modes = st.modes(st.loads(template_text("two-beams")))
    grown = modes[int(modes.growth_rate[0].argmax())]
    expect(page.locator("#st-mode-title")).to_have_text(f"Mode {grown.number} at μ = 0.1")
    expect(frame.locator("#growth")).to_contain_text("unstable: growth rate")
    expect(page.locator("#st-mode-facts")).to_contain_text("fed in")
    shot(page, "mode", full_page=True)


def test_a_click_on_a_branch_chooses_its_mode(page: Any):
    place = page.evaluate("""() => {
      const chart = getElement(stridor.state.charts.frequency).chart, b = stridor.state.locus.branches[11], k = 20;
      const [x, y] = chart.convertToPixel({xAxisIndex: 0, yAxisIndex: 0}, [stridor.state.locus.mu[k], b.frequency_hz[k]]);
      const box = chart.getDom().getBoundingClientRect();
      return [box.left + x, box.top + y, b.branch];
    }""")
    page.mouse.click(place[0], place[1])
    wait(page, f"stridor.state.shape?.branch === {place[2]}")
    expect(page.locator("#st-mode-title")).to_have_text(f"Mode {place[2]} at μ = 0.1")
    expect(page.locator("#st-mode-shown")).to_be_visible()
    expect(page.locator(".st-chosen button")).to_have_text([str(place[2])])
    drawn = page.evaluate("getElement(stridor.state.charts.frequency).chart.getOption().series.find((s) => s.id === 'chosen mode').data")
    assert {point[2] for point in drawn if point[0] != "-"} == {place[2]}


BLOCK = """
title = "A block"
materials.steel = { young_modulus = 200e9, density = 7800.0, poisson_ratio = 0.3 }
[bodies.block]
type = "solid"
material = "steel"
model = "3d"
mesh = { shape = "block", corner = [0, 0, 0], size = [0.1, 0.03, 0.01], divisions = [6, 2, 1], cells = "hexahedron" }
[supports.root]
at = "block.left"
fixed = ["x", "y", "z"]
[modal]
max_frequency_hz = 20e3
"""
CLICKED = """() => {
  const chart = getElement(stridor.state.charts.frequency).chart, b = stridor.state.locus.branches[1];
  const [x, y] = chart.convertToPixel({xAxisIndex: 0, yAxisIndex: 0}, [stridor.state.locus.mu[2], b.frequency_hz[2]]), box = chart.getDom().getBoundingClientRect();
  return [box.left + x, box.top + y, b.branch];
}"""


def test_a_mode_of_a_solid_is_played_by_the_graphics_card(page: Any, tmp_path: Path):
    """What that needs is asked of the page's own server, once, when there is a solid to show; a mode of lines does without."""
    asked: list[str] = []
    page.on("request", lambda request: asked.append(request.url) if "viewer" in request.url else None)
    page.locator("#st-modes-list button").first.click()
    wait(page, "stridor.state.shape?.motion")
    file = tmp_path / "block.toml"
    file.write_text(BLOCK, encoding="utf-8")
    page.set_input_files("input[type=file]", file)
    wait(page, f"document.querySelector('#st-title').textContent.includes('block') && {SOLVED} && stridor.state.locus?.branches.length > 1 && stridor.state.locus.mu.length > 2")
    frame = page.frames[1]
    assert (frame.evaluate("card"), asked) == (None, [])
    x, y, branch = page.evaluate(CLICKED)
    page.mouse.click(x, y)
    wait(page, f"stridor.state.shape?.branch === {branch}")
    frame.wait_for_function("card !== null && card.renderer.info.render.triangles === 2 * 2 * (6 * 2 + 6 * 1 + 2 * 1)")
    expect(page.frame_locator("#st-mode-frame").locator("h1")).to_contain_text(f"Mode {branch}:")
    first, phase = page.locator("#st-mode-frame").screenshot(), frame.evaluate("state.phase")
    frame.wait_for_function("before => Math.abs(state.phase - before) > 1", arg=phase)
    assert page.locator("#st-mode-frame").screenshot() != first
    shot(page, "solid", full_page=True)
    page.get_by_role("button", name="Examples").click()
    page.get_by_text("two-beams", exact=True).click()
    wait(page, "stridor.state.at?.mu === 0.1 && stridor.state.at.modes.length > 8")
    page.locator("#st-modes-list button").nth(8).click()
    frame.wait_for_function("data.names.length === 2 && card.renderer.info.render.triangles > 100 && width > 200 && height > 100")
    shot(page, "lines", full_page=True)
    assert asked == [page.url.partition("#")[0] + "viewer.js"]


ON_CHART = """(name) => {
  const o = getElement(stridor.state.charts[name]).chart.getOption(), modes = o.series.find((s) => s.id === "modes");
  return {x: [o.xAxis[0].name, o.xAxis[0].min, o.xAxis[0].max], y: o.yAxis[0].name, colour: modes.lineStyle.color, text: o.xAxis[0].axisLabel.color,
    points: modes.data.filter((p) => p[0] !== "-").length, all: stridor.state.locus.branches.flatMap((b) => b.frequency_hz).filter((f) => f !== null).length, ids: o.series.map((s) => s.id)};
}"""


def test_axes_and_colours_stay_between_moves_and_follow_what_changes_them(page: Any, tmp_path: Path):
    """Between moves charts are told their curves alone."""
    before = page.evaluate(ON_CHART, "frequency")
    slide(page, "bodies.beam1.angle_deg", 84.0)
    wait(page, "Math.abs(stridor.state.values['bodies.beam1.angle_deg'] - 84) < 1 && !document.body.classList.contains('st-busy')")
    moved = page.evaluate(ON_CHART, "frequency")
    assert moved["x"] == before["x"] == ["friction coefficient μ", 0, 1]
    assert (moved["y"], moved["colour"], moved["ids"]) == (before["y"], before["colour"], before["ids"])
    assert moved["points"] == moved["all"] > 100
    page.get_by_role("button", name="Light/dark").click()
    wait(page, f"({ON_CHART})('frequency').text !== '{before['text']}'")
    night = page.evaluate(ON_CHART, "frequency")
    assert night["colour"] != before["colour"]
    other = tmp_path / "narrow.toml"
    other.write_text(st.loads(template_text("two-beams"), ["modal.friction_range=[0.0, 0.5]"]).text, encoding="utf-8")
    page.set_input_files("input[type=file]", other)
    wait(page, "stridor.state.high === 0.5 && stridor.state.locus !== null")
    wait(page, f"({ON_CHART})('frequency').x[2] === 0.5")
    assert page.evaluate(ON_CHART, "growth")["x"] == ["friction coefficient μ", 0, 0.5]


def test_a_broken_file_is_refused_as_on_the_command_line(page: Any, tmp_path: Path):
    path = tmp_path / "broken.toml"
    path.write_text(template_text("two-beams").replace("length = 0.05", "length = -1.0"), encoding="utf-8")
    with pytest.raises(st.CaseError) as refused:
        st.load(path)
    page.set_input_files("input[type=file]", path)
    problem = page.locator("#st-problem")
    problem.wait_for(state="visible", timeout=PATIENT)
    assert problem.inner_text().strip() == str(refused.value)
    shot(page, "refused")
    slide(page, "mu", 0.2)  # the page goes on with the last good state
    wait(page, "stridor.state.at.mu === 0.2")
    expect(page.locator("#st-modes-title")).to_have_text("Modes at μ = 0.2")
    mended = tmp_path / "mended.toml"
    mended.write_text(template_text("two-beams").replace("angle_deg = 85.0", "angle_deg = 84.0"), encoding="utf-8")
    page.set_input_files("input[type=file]", mended)
    wait(page, "document.querySelector('[data-number=\"bodies.beam1.angle_deg\"]').value === '84'")
    expect(problem).to_be_hidden()
    huge = tmp_path / "huge.toml"  # of good numbers, but nothing that could be computed with
    huge.write_text(HUGE_CASE, encoding="utf-8")
    page.set_input_files("input[type=file]", huge)
    expect(problem).to_contain_text("makes 6.0e+10 degrees of freedom")
    assert page.input_value('[data-number="bodies.beam1.angle_deg"]') == "84"
    slide(page, "mu", 0.3)
    wait(page, f"stridor.state.at.mu === 0.3 && {SOLVED}")
    expect(page.locator("#st-title")).to_contain_text("Two beams")
    expect(page.locator("#st-said")).to_contain_text("Growth begins")


def test_a_number_that_is_refused_is_said_and_taken_back(page: Any):
    slide(page, "loads.press.force.1", 20.0)
    page.locator("#st-problem").wait_for(state="visible", timeout=PATIENT)
    with pytest.raises(st.AnalysisError) as refused:
        st.modes(st.loads(template_text("two-beams"), ["loads.press.force.1=20.0"]), check=False)
    expect(page.locator("#st-problem")).to_have_text(str(refused.value))
    expect(page.locator("#st-said")).to_contain_text("Of the last numbers that could be computed: ")
    expect(page.locator("#st-modes-said")).to_contain_text("Of the last numbers that could be computed. ")
    page.get_by_role("button", name="Undo").click()
    wait(page, "document.querySelector('[data-number=\"loads.press.force.1\"]').value === '-20'")
    page.locator("#st-problem").wait_for(state="hidden", timeout=PATIENT)
    expect(page.locator("#st-modes-said")).not_to_contain_text("Of the last numbers")


def test_a_link_restores_the_state_and_the_file_has_it(page: Any, browser: Any):
    slide(page, "bodies.beam1.angle_deg", 82.0)
    slide(page, "mu", 0.25)
    wait(page, "stridor.state.at?.mu === 0.25 && location.hash.length > 20")
    with page_at(browser, page.url) as other:
        expect(other.locator('[data-number="bodies.beam1.angle_deg"]')).to_have_value("82")
        wait(other, "stridor.state.at.mu === 0.25")
        assert other.evaluate("stridor.state.onsets.first.mu") == st.onsets(st.loads(template_text("two-beams")).with_({"bodies.beam1.angle_deg": 82.0})).first.mu
    with page.expect_download() as saved:
        page.get_by_role("button", name="Save file").click()
    case = st.load(saved.value.path())
    assert case.bodies["beam1"].angle_deg == 82.0
    assert case.contacts["A"].friction.coefficient == 0.25


def test_two_pages_at_once_do_not_know_of_each_other(page: Any, browser: Any, address: str):
    with page_at(browser, address) as other:
        slide(page, "mu", 0.3)
        slide(other, "mu", 0.4)
        wait(page, "stridor.state.at.mu === 0.3")
        wait(other, "stridor.state.at.mu === 0.4")
        for one, mu in ((page, "0.3"), (other, "0.4")):
            expect(one.locator('[data-number="mu"]')).to_have_value(mu)
            expect(one.locator("#st-modes-title")).to_have_text(f"Modes at μ = {mu}")


def test_two_hundred_moves_in_a_row_make_no_queue(page: Any):
    drawn = page.evaluate("stridor.state.drawn.locus")
    older = page.evaluate("""async () => {
      const slider = document.querySelector('[data-path="bodies.beam1.angle_deg"]'), older = [];
      const number = document.querySelector('[data-number="bodies.beam1.angle_deg"]');
      for (let k = 0; k < 200; k++) {
        slider.value = 60 + (k % 80);
        slider.dispatchEvent(new Event("input", { bubbles: true }));
        const moved = number.value;
        await new Promise((done) => setTimeout(done, 10));
        if (number.value !== moved || Number(slider.value) !== 60 + (k % 80)) older.push([moved, number.value]);
      }
      return older;
    }""")
    assert older == []  # what the server repeats of moves before does not take the hand from the slider
    last = 55 + 60 * (60 + 199 % 80) / 200
    wanted = st.onsets(st.loads(template_text("two-beams")).with_({"bodies.beam1.angle_deg": last})).first.mu
    try:
        wait(page, f"stridor.state.onsets?.first?.mu === {wanted!r}")
    except Exception as error:  # of playwright, which may not be installed
        told = "[stridor.state.values, stridor.state.onsets?.first, stridor.state.drawn, document.body.innerText.slice(0, 400)]"
        raise AssertionError(f"not at {last}, {wanted!r}: {page.evaluate(told)}") from error
    number(page, "bodies.beam1.angle_deg", last)
    assert page.evaluate("stridor.state.drawn.locus") - drawn < 150  # answers, not two hundred


def test_words_that_were_measured_once_are_not_kept(browser: Any, address: str):
    measured = """async () => {
      const { echarts } = await import("nicegui-echart"), widths = [];
      for (let k = 0; k < 5000; k++) widths.push(echarts.format.getTextRect(`${(k / 7).toFixed(4)} Hz`, "12px sans-serif").width);
      const context = document.createElement("canvas").getContext("2d");
      context.font = "12px sans-serif";
      return [widths.at(-1), context.measureText(`${(4999 / 7).toFixed(4)} Hz`).width];
    }"""
    with page_at(browser, address) as page:  # which nothing was measured on before
        ours, canvas = page.evaluate(measured)
        assert ours == canvas > 0
        chunks: list[str] = []
        counter = page.context.new_cdp_session(page)
        counter.on("HeapProfiler.addHeapSnapshotChunk", lambda event: chunks.append(event["chunk"]))
        counter.send("HeapProfiler.takeHeapSnapshot")
    heap = json.loads("".join(chunks))
    fields, names = heap["snapshot"]["meta"]["node_fields"], heap["strings"]
    kept = sum(names[name] == "blink::PlainTextNode" for name in heap["nodes"][fields.index("name") :: len(fields)])
    assert 0 < kept < 2500  # of 5000 and what the page itself shows


def test_friction_of_contacts_that_is_replaced_is_said(page: Any, tmp_path: Path):
    expect(page.locator(".st-lever .st-note")).to_have_count(0)
    text = template_text("two-beams")
    contact = text[text.index("[contacts.A]") : text.index("# Other laws:")]
    second = contact.replace("contacts.A", "contacts.B").replace("beam1.tip", "beam1@0.025").replace("coefficient = 0.1", "coefficient = 0.3")
    path = tmp_path / "two.toml"
    path.write_text(text.replace("# Other laws:", f"{second}\n# Other laws:"), encoding="utf-8")
    page.set_input_files("input[type=file]", path)
    note = page.locator(".st-lever .st-note")
    note.wait_for(state="visible", timeout=PATIENT)
    expect(note).to_have_text("The case gives its contacts different μ (A 0.1, B 0.3): this one replaces them all.")
    slider = page.locator('[data-path="mu"]')
    expect(slider).to_have_attribute("aria-describedby", note.get_attribute("id"))
    expect(page.locator('[data-number="mu"]')).to_have_value("0.3")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_a_phone_and_a_small_screen(browser: Any, address: str, scheme: str):
    with page_at(browser, address, color_scheme=scheme) as page:
        page.locator(".st-grows button").first.click()
        wait(page, "document.querySelector('#st-tornado table') !== null")
        assert page.evaluate("document.body.classList.contains('body--dark')") is (scheme == "dark")
        page.evaluate("scrollTo(0, 0)")
        for name, width, height in (("screen", 1280, 720), ("phone", 390, 844)):
            page.set_viewport_size({"width": width, "height": height})
            page.wait_for_timeout(500)
            assert page.evaluate("document.documentElement.scrollWidth") <= width
            wider = page.evaluate("""() => [...document.querySelectorAll('.st-bench *')].filter((e) => e.getClientRects().length
              && !e.closest('.st-scroll, .st-mu, svg') && e.scrollWidth > e.clientWidth + 1 && e.clientWidth > 0 && getComputedStyle(e).display !== 'inline')
              .map((e) => `${e.tagName}.${e.className}#${e.id} ${e.scrollWidth}>${e.clientWidth} ${e.textContent.slice(0, 20)}`)""")
            assert not wider, wider
            shot(page, f"{name}-{scheme}", full_page=name == "phone")


def test_controls_have_names_and_charts_have_words(page: Any):
    nameless = page.evaluate("""() => [...document.querySelectorAll('button, input, [role=slider], [role=tab], iframe')]
      .filter((e) => !e.closest('.st-upload') && e.getClientRects().length)
      .filter((e) => !(e.getAttribute('aria-label') || e.title || e.textContent.trim() || (e.id && document.querySelector(`label[for="${CSS.escape(e.id)}"]`))))
      .map((e) => e.outerHTML.slice(0, 120))""")
    assert nameless == []
    said = page.evaluate("[...document.querySelectorAll('.st-chart')].filter((c) => c.getClientRects().length).map((c) => [c.getAttribute('role'), c.getAttribute('aria-label')])")
    assert [role for role, _ in said] == ["img", "img"]
    assert all("μ = 0.076725" in words for _, words in said)


def test_who_has_not_the_token_is_refused(address: str):
    base = address.rsplit("/", 2)[0]
    for path in ("/", "/wrong/", "/_nicegui/", "/docs", "/openapi.json"):
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(base + path)
        assert refused.value.code == 403
        assert "lacks the token" in refused.value.read().decode()
    assert urllib.request.urlopen(address).status == 200


def children_of(pid: int) -> list[int]:
    return [int(p) for task in Path(f"/proc/{pid}/task").iterdir() for p in (task / "children").read_text().split()]


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
@pytest.mark.parametrize(
    "name", ["SIGINT", *(pytest.param(name, marks=pytest.mark.slow) for name in ("SIGTERM", "SIGHUP"))]
)
def test_a_signal_ends_it_with_its_processes_and_files_and_without_a_word(browser: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str):
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    with serving() as (process, address):
        context = browser.new_context()
        page = context.new_page()
        page.goto(address)
        page.wait_for_function(f"{SOLVED} && {READY}", timeout=PATIENT)
        page.click("#st-both-report")  # which writes files
        wait(page, "document.querySelector('#st-both-said').textContent.endsWith('…') && !document.querySelector('#st-both-stop').disabled")
        until = time.monotonic() + 3.0
        while time.monotonic() < until and not list(tmp_path.glob("stridor-page-*/both-*/*")):
            time.sleep(0.05)
        forking = children_of(process.pid)
        own = [*forking, *(pid for parent in forking for pid in children_of(parent))]  # pages and runs are forked off
        assert len(own) >= len(forking) + 2
        process.send_signal(getattr(signal, name))
        out, err = process.communicate(timeout=20)
        assert (process.returncode, out, err) == (0, "", "")
        assert list(tmp_path.iterdir()) == []
        until = time.monotonic() + 5.0
        while time.monotonic() < until and any(Path(f"/proc/{pid}").exists() for pid in own):
            time.sleep(0.1)
        assert not any(Path(f"/proc/{pid}").exists() for pid in own)
        context.close()


def test_a_case_that_is_none_is_refused_before_anything_is_served(tmp_path: Path):
    done = stridor("app", "none.toml", cwd=tmp_path)
    assert (done.returncode, done.stderr) == (2, "stridor: none.toml: no such file\n")
