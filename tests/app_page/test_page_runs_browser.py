"""What takes long on the page, in a real browser: runs that are watched, heard, stopped and reloaded, maps, comparisons."""

from __future__ import annotations

import time
from collections.abc import Generator
from pathlib import Path
from typing import Any

import pytest
from browsing import PATIENT, READY, SOLVED, WITH_BROWSER, expect, number, page_at, serving, shot, slide, wait

import stridor as st
from benches import paper_case

pytest.importorskip("nicegui", reason="the extra app is not installed")
pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
pytestmark = WITH_BROWSER

SHORT = {
    "bodies.beam1.elements": 6, "bodies.beam2.elements": 12, "temporal.step": 2e-7, "temporal.record_every": 5,
    "phases.press.duration": 5e-4, "phases.slide.duration": 4e-3, "contacts.A.friction.coefficient": 0.3,
}  # fmt: skip
LONG = SHORT | {"phases.slide.duration": 300.0, "temporal.record_every": 2000}


def served(folder: Path, changes: dict[str, Any]) -> Any:
    path = folder / "bench.toml"
    path.write_text(paper_case().with_(changes).to_toml(), encoding="utf-8")
    return serving(str(path))


@pytest.fixture(scope="module")
def shortly(tmp_path_factory: pytest.TempPathFactory) -> Generator[tuple[Any, str]]:
    with served(tmp_path_factory.mktemp("short"), SHORT) as found:
        yield found


@pytest.fixture(scope="module")
def short(shortly: tuple[Any, str]) -> str:
    return shortly[1]


@pytest.fixture(scope="module")
def shown(browser: Any, short: str) -> Generator[Any]:
    """A page of the short case, for what does not ask what was done on it before."""
    with page_at(browser, short) as page:
        yield page


@pytest.fixture(scope="module")
def endless(tmp_path_factory: pytest.TempPathFactory) -> Generator[tuple[Any, str]]:
    with served(tmp_path_factory.mktemp("long"), LONG) as found:
        yield found


def processes_of(server: Any) -> int:
    """How many processes the server has: that of each page, and those of runs, all forked off one of its own."""
    parents: dict[int, int] = {}
    for status in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = status.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if words[0] != "Z":
            parents[int(status.parent.name)] = int(words[1])
    return sum(parents.get(parent) == server.pid for parent in parents.values())


def test_a_run_is_drawn_and_heard(browser: Any, shortly: tuple[Any, str]) -> None:
    server, address = shortly
    with page_at(browser, address) as page:
        page.click("#st-run-go")
        wait(page, "document.querySelector('#st-run-said').textContent.startsWith('At μ = 0.3: last phase')")
        run = st.simulate(paper_case().with_(SHORT))
        seen = page.evaluate("stridorRun.page.picture")
        assert seen["done"] == seen["planned"] == run.steps
        assert max(seen["normal_force"][0]["high"]) == run.normal_force.max()
        drawn = page.evaluate("[...document.querySelectorAll('.st-run-chart')].map((c) => c.getAttribute('aria-label'))")
        assert all(words for words in drawn)
        assert "Modes that grow:" in drawn[3]
        heard = st.sound(run)
        page.click("#st-run-listen")
        wait(page, "stridorRun.page.sound !== null")
        assert page.evaluate("stridorRun.page.sound.seconds") == pytest.approx(heard.seconds, rel=0.01)
        expect(page.locator("#st-run-said")).to_contain_text(heard.sentence)
        expect(page.locator("#st-run-listen")).to_have_text("Silence")
        # Nor does the server load what makes it: that is half as much memory again, which it would keep.
        assert "scipy/signal" not in Path(f"/proc/{server.pid}/maps").read_text()
        page.click("#st-run-listen")
        wait(page, "stridorRun.page.sound === null")
        page.fill('[data-number="mu"]', "0.35")
        page.press('[data-number="mu"]', "Enter")
        wait(page, "document.querySelector('#st-run-title').textContent === 'Run in time at μ = 0.3: the numbers have changed since'")
        shot(page, "run", full_page=True)


def test_a_run_grows_is_stopped_and_waits_for_its_turn(browser: Any, endless: tuple[Any, str]) -> None:
    _, address = endless
    with page_at(browser, address) as page, page_at(browser, address) as other:
        page.click("#st-run-go")
        wait(page, "stridorRun.page.picture !== null")
        end = page.evaluate("stridorRun.page.picture.end")
        wait(page, f"stridorRun.page.picture.end > {end}")
        assert all(page.evaluate("[...document.querySelectorAll('.st-run-chart')].map((c) => c.getAttribute('aria-label'))"))
        other.click("#st-run-go")
        if page.evaluate("navigator.hardwareConcurrency") <= 2:
            wait(other, "document.querySelector('#st-run-said').textContent === 'Waiting for its turn: number 1 in the queue.'")
        page.click("#st-run-listen")  # of what there is by now
        wait(page, "stridorRun.page.sound !== null || document.querySelector('#st-run-said').textContent.startsWith('No sound')")
        page.click("#st-run-stop")
        wait(page, "document.querySelector('#st-run-said').textContent.includes('stopped after')")
        done, planned = page.evaluate("[stridorRun.page.picture.done, stridorRun.page.picture.planned]")
        expect(page.locator("#st-run-said")).to_contain_text(f"stopped after {done} of {planned} steps")
        wait(other, "stridorRun.page.picture !== null")
        expect(other.locator("#st-run-go")).to_be_disabled()
        expect(page.locator("#st-run-go")).to_be_enabled()


@pytest.mark.slow
def test_a_reload_in_the_middle_of_a_run_ends_it_and_the_page_goes_on(browser: Any, endless: tuple[Any, str]) -> None:
    server, address = endless
    with page_at(browser, address, lost=True) as page:
        page.click("#st-run-go")
        wait(page, "stridorRun.page.picture !== null")
        page.reload()  # of which the server is told
        wait(page, f"{SOLVED} && {READY}")
        until = time.monotonic() + 20
        while processes_of(server) > 1 and time.monotonic() < until:
            time.sleep(0.1)
        assert processes_of(server) <= 1
        page.click("#st-run-go")
        wait(page, "stridorRun.page.picture !== null")
    until = time.monotonic() + 20  # twice as long as a page may be away
    while processes_of(server) and time.monotonic() < until:
        time.sleep(0.1)
    assert processes_of(server) == 0


def test_a_page_that_is_left_ends_what_it_has_at_once(browser: Any, endless: tuple[Any, str]) -> None:
    server, address = endless
    with page_at(browser, address) as page:
        page.evaluate("dispatchEvent(new PageTransitionEvent('pagehide', { persisted: true }))")  # it may come back
        slide(page, "mu", 0.2)
        wait(page, "stridor.state.at.mu === 0.2")
        assert processes_of(server) > 0
        page.evaluate("dispatchEvent(new PageTransitionEvent('pagehide'))")
        until = time.monotonic() + 60
        while processes_of(server) and time.monotonic() < until:
            time.sleep(0.1)
        assert processes_of(server) == 0
        assert page.evaluate("socket.connected")  # it was not merely lost


def test_both_approaches_and_the_report(browser: Any, short: str, tmp_path: Path) -> None:
    with page_at(browser, short) as page:
        page.click("#st-both-go")
        wait(page, "document.querySelectorAll('#st-both-tables table').length === 2")
        # At the μ of the page, whatever the case says of comparisons.
        found = st.compare(paper_case().with_(SHORT), [0.3])
        expect(page.locator("#st-both-tables caption").first).to_have_text("Both approaches at μ = 0.3")
        expect(page.locator("#st-both-said")).to_have_text(found.comparisons[0].verdict)
        cells = page.locator("#st-both-tables").inner_text()
        assert f"{found.comparisons[0].modal_eigenvalue.real:.1f}" in cells
        with page.expect_download(timeout=2 * PATIENT) as got:
            page.click("#st-both-report")
        assert got.value.suggested_filename == "bench-report.html"
        got.value.save_as(tmp_path / "report.html")
        text = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert "Do both approaches agree?" in text
        assert "Both approaches at μ = 0.3" in text
        assert "http://" not in text.split("<body")[0]
        shot(page, "compare", full_page=True)


@pytest.mark.slow
def test_a_click_on_the_map_goes_there(browser: Any, short: str) -> None:
    with page_at(browser, short) as page:
        page.get_by_role("tab", name="Stability map").click()
        page.fill("#st-map-x-high", "0.6")
        page.fill("#st-map-y-low", "5e9")
        page.click("#st-map-go")
        wait(page, "stridorMap.page.map !== null && !document.querySelector('#st-map-go').disabled")
        chart = "getElement(stridorMap.page.chart).chart"
        x, y = page.evaluate(f"{chart}.convertToPixel({{gridIndex: 0}}, [0.25, 1.5e10])")
        page.locator(".st-map-chart").click(position={"x": x, "y": y})
        wait(page, "Math.abs(stridor.state.values.mu - 0.25) < 0.005")
        shot(page, "map", full_page=True)
        page.get_by_role("tab", name="Bench").click()
        stiffness = float(page.locator('[data-number="contacts.A.stiffness"]').input_value())
        assert stiffness == pytest.approx(1.5e10, rel=0.02)
        mu = page.evaluate("stridor.state.values.mu")
        wait(page, f"stridor.state.at.mu === {mu}")
        page.get_by_role("button", name="Undo").click()  # once, of both numbers
        wait(page, "stridor.state.values.mu === 0.3 && stridor.state.at.mu === 0.3")
        given = paper_case().contacts["A"].stiffness
        number(page, "contacts.A.stiffness", float(given))
        expect(page.get_by_role("button", name="Undo")).to_be_disabled()
        # Nonsense in a field is refused in words, and the page goes on.
        page.get_by_role("tab", name="Stability map").click()
        page.fill("#st-map-x-high", "much")
        page.click("#st-map-go")
        wait(page, "document.querySelector('#st-map-said').textContent.includes('two numbers, the smaller one first')")
        expect(page.locator("#st-map-go")).to_be_enabled()


@pytest.mark.slow
def test_another_case_has_nothing_of_the_one_before(browser: Any, short: str) -> None:
    with page_at(browser, short) as page:
        page.get_by_role("tab", name="Stability map").click()
        page.click("#st-map-go")
        wait(page, "stridorMap.page.map !== null")
        page.evaluate("window.seen = []")
        # What is told of the first moment under the other name.
        page.evaluate("""const told = stridor.forget; document.querySelector('#st-title') && new MutationObserver(() =>
            window.seen.push([document.querySelector('#st-said').textContent, document.querySelectorAll('#st-modes-list tr').length])
        ).observe(document.querySelector('#st-title'), { childList: true })""")
        page.get_by_role("button", name="Examples").click()
        page.get_by_text("two-beams", exact=True).click()
        wait(page, "stridor.state.onsets !== null && document.querySelector('#st-map-said').textContent === 'Another case is open.'")
        first_words, first_rows = page.evaluate("window.seen[0]")
        assert "solved" not in first_words
        assert first_rows == 0
        page.wait_for_timeout(3000)  # the map of the case before, were it still made
        assert page.evaluate("stridorMap.page.map") is None
        expect(page.locator("#st-map-go")).to_be_enabled()


def test_a_run_may_follow_at_once(shown: Any) -> None:
    for mu in ("0.3", "0.2"):
        shown.fill('[data-number="mu"]', mu)
        shown.press('[data-number="mu"]', "Enter")
        wait(shown, f"stridor.state.values.mu === {mu} && !document.querySelector('#st-run-go').disabled")
        shown.click("#st-run-go")
        wait(shown, f"document.querySelector('#st-run-said').textContent.startsWith('At μ = {mu}: ')")
        expect(shown.locator("#st-run-title")).to_have_text("Run in time")


def test_words_about_a_file_stay_to_be_read(shown: Any, tmp_path: Path) -> None:
    broken = tmp_path / "broken.toml"
    broken.write_text("title = 1\n", encoding="utf-8")
    shown.set_input_files("input[type=file]", broken)
    shown.locator("#st-problem").wait_for(state="visible")
    words = shown.inner_text("#st-problem")
    shown.evaluate("stridor.show('at', stridor.state.at, false)")  # an answer that was under way
    assert shown.inner_text("#st-problem") == words


@pytest.mark.slow
def test_sensitivities_of_a_large_model_are_asked_for(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "fine.toml"
    path.write_text(paper_case().with_({"bodies.beam2.elements": 180, "bodies.beam2.damping.stiffness": 1e-9}).to_toml(), encoding="utf-8")
    with serving(str(path)) as (_, address), page_at(browser, address) as page:
        page.click('#st-modes-list [data-branch="8"]')
        button = page.locator("#st-tornado-go")
        expect(button).to_contain_text("Sensitivities of this mode (takes about ")
        shot(page, "sensitivities-offered", full_page=True)
        button.click()
        expect(page.locator("#st-tornado-stop")).to_be_visible()
        page.click("#st-tornado-stop")
        expect(page.locator("#st-tornado-said")).to_contain_text("Stopped")
        button.click()
        wait(page, "document.querySelectorAll('#st-tornado tbody tr').length > 5")
        expect(page.locator("#st-tornado-ask")).to_be_hidden()
        expect(page.locator("#st-tornado")).to_contain_text("materials.steel.density")
        shot(page, "sensitivities", full_page=True)
        slide(page, "mu", 0.2)  # another mode: what it was is not shown under it
        wait(page, "document.querySelectorAll('#st-tornado tbody tr').length === 0")
        expect(button).to_be_visible()
