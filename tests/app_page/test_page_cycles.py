"""Limit cycles at the friction of the page: what the process tells, and what a browser shows of it."""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsing import WITH_BROWSER, expect, page_at, serving, shot, slide, wait

import stridor as st
from mode_coupling import mode_coupling
from stridor.app.page.runs import ENDS, Queue, Run, Wish
from stridor.case import Case, loads, template_text
from stridor.view.cycle_shown import cycle_shown, strips

MU = 1.2
QUIET = 0.3  # nothing grows there, and what is pushed dies out
# Shooting takes no cubic springs, harmonic balance no static friction above the kinetic one.
NEITHER = {
    "contacts.rub.friction": {"law": "static-kinetic", "coefficient": 0.5, "static_coefficient": 0.9}, "springs.k1.cubic": 1.0
}  # fmt: skip
PATIENCE = 120.0


def case() -> Case:
    return mode_coupling(damping=0.02, speed=0.1)


class Told:
    """What a search has said, and waiting for more of it."""

    def __init__(self) -> None:
        self.parts: list[tuple[str, Any]] = []
        self._news = threading.Condition()

    def __call__(self, part: str, content: Any) -> None:
        with self._news:
            self.parts.append((part, content))
            self._news.notify_all()

    def wait(self, *names: str) -> Any:
        """Content of the first such part."""
        until = time.monotonic() + PATIENCE
        with self._news:
            while True:
                for part, content in self.parts:
                    if part in names:
                        return content
                assert self._news.wait(until - time.monotonic()), f"never heard {names}: {[p for p, _ in self.parts]}"

    def all(self, name: str) -> list[Any]:
        return [content for part, content in self.parts if part == name]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[[Case, float], tuple[Run, Told]]]:
    runs: list[Run] = []

    def started(case: Case, mu: float) -> tuple[Run, Told]:
        told = Told()
        runs.append(Run(Wish(case.to_toml(), mu, str(tmp_path), "cycles"), told, Queue(1)))
        return runs[-1], told

    yield started
    for run in runs:
        run.close()


@pytest.fixture(scope="module")
def wanted() -> Any:
    found = st.cycles(case(), [MU])
    assert found.cycles
    return found


def test_cycles_told_are_those_of_the_package(start: Any, wanted: Any) -> None:
    _, told = start(case(), MU)
    end = told.wait(*ENDS)
    assert told.parts[-1][0] == "done"
    found = [json.loads(json.dumps(c, allow_nan=False)) for c in told.all("cycle")]
    assert found == [json.loads(json.dumps(cycle_shown(c).to_json())) for c in wanted.cycles]
    assert end["sentence"] == wanted.sentence
    assert (end["missing"], end["notes"]) == (wanted.missing, wanted.notes)
    assert any("motion 1 of 4 at μ = 1.2, from the mode at " in words for words in told.all("log"))


def test_a_cycle_in_plain_numbers_is_the_cycle(wanted: Any) -> None:
    (cycle,) = wanted.cycles
    shown = cycle_shown(cycle)
    assert set(cycle.kinds) == {"slip", "stick", "separation", "reversal"}
    assert shown.portrait is not None
    assert shown.portrait.seconds == cycle.period
    size = np.ptp(shown.portrait.displacement)
    assert shown.portrait.displacement[0] == pytest.approx(shown.portrait.displacement[-1], abs=1e-9 * size)
    # Velocity is the derivative of what is drawn beside it.
    slope = np.gradient(shown.portrait.displacement, cycle.time)
    np.testing.assert_allclose(slope[1:-1], shown.portrait.velocity[1:-1], atol=0.01 * max(shown.portrait.velocity))
    (contact,) = shown.contacts
    assert (contact.strips[0][0], contact.strips[-1][1]) == (0.0, 1.0)
    lasting = [sum(b - a for a, b, kind in contact.strips if kind == w) for w in ("separation", "stick", "slip")]
    np.testing.assert_allclose(lasting, cycle.shares[0], atol=2.0 / len(cycle.time))
    assert strips(np.array([0.0, 0.5, 1.0]), np.array([2, 1, 1])) == [(0.0, 0.25, "slip"), (0.25, 1.0, "stick")]


def test_what_cannot_be_sought_is_refused_in_words(start: Any) -> None:
    _, told = start(case().with_(NEITHER), MU)
    words = told.wait(*ENDS)
    assert told.parts[-1][0] == "refused"
    assert "no cycles can be sought of it" in words
    assert "the exact stepper takes" in words


def test_a_search_is_stopped_amid_a_motion(start: Any) -> None:
    """Each motion of the two beams is followed for many seconds, in which nothing is told."""
    run, told = start(loads(template_text("two-beams")), 0.3)
    until = time.monotonic() + PATIENCE
    while not any("motion 1 of " in words for words in told.all("log")) and time.monotonic() < until:
        time.sleep(0.05)
    time.sleep(1.0)
    asked = time.monotonic()
    run.stop()
    end = told.wait(*ENDS)
    assert time.monotonic() - asked < 5.0
    assert told.parts[-1][0] == "stopped"
    assert end["sentence"] == "the search was stopped before any limit cycle was found"
    assert not any("motion 2 of " in words for words in told.all("log"))


# -- in a browser -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def coupled(tmp_path_factory: pytest.TempPathFactory) -> Generator[str]:
    path = tmp_path_factory.mktemp("cycles") / "coupling.toml"
    path.write_text(case().to_toml(), encoding="utf-8")
    with serving(str(path)) as (_, address):
        yield address


ENDED = "!document.querySelector('#st-cycle-go').disabled"
LABELS = "[...document.querySelectorAll('.st-cycle-chart')].filter((c) => !c.hidden).map((c) => c.getAttribute('aria-label'))"


@WITH_BROWSER
def test_cycles_are_drawn_and_chosen(browser: Any, coupled: str, wanted: Any) -> None:
    (cycle,) = wanted.cycles
    with page_at(browser, coupled) as page:
        assert page.evaluate(LABELS) == []  # nothing is drawn that was not found
        slide(page, "mu", MU)
        wait(page, f"stridor.state.values.mu === {MU}")
        page.click("#st-cycle-go")
        wait(page, f"{ENDED} && stridorCycle.page.cycles.length === 1")
        expect(page.locator("#st-cycle-said")).to_have_text(f"{wanted.sentence}.")
        expect(page.locator("#st-cycle-more")).to_have_text("There may be cycles to which none of these motions leads.")
        cells = page.locator("#st-cycle-found tbody td").all_inner_texts()
        assert float(cells[1]) == pytest.approx(cycle.frequency_hz, rel=1e-5)
        assert float(cells[2]) == pytest.approx(cycle.largest_multiplier, rel=1e-3)
        assert float(cells[3]) == pytest.approx(cycle.slip_amplitude, rel=1e-3)
        assert cells[4] == "stable"
        portrait, force, slip = page.evaluate(LABELS)
        assert f"one period of {cycle.period:.4g} s" in portrait
        assert f"normal from {cycle.normal_force.min():g} to {cycle.normal_force.max():.4g} N" in force
        assert f"to {cycle.slip_velocity.max():.4g} m/s; separation, slip, stick." in slip
        shot(page, "cycles", full_page=True)
        # Another one is chosen by its number.
        page.evaluate("stridorCycle.show('cycle', { ...stridorCycle.page.cycles[0], stable: false, period: 2 * stridorCycle.page.cycles[0].period })")
        assert page.evaluate(LABELS)[0] == portrait
        page.locator("#st-cycle-found tbody button").nth(1).click()
        assert page.evaluate(LABELS)[0] != portrait
        expect(page.locator("#st-cycle-found tr.st-chosen")).to_contain_text("unstable")
        slide(page, "mu", 0.6)
        expect(page.locator("#st-cycle-title")).to_have_text(f"Limit cycles at μ = {MU}: the numbers have changed since")


@WITH_BROWSER
def test_where_every_motion_dies_out_that_is_said(browser: Any, coupled: str) -> None:
    with page_at(browser, coupled) as page:
        slide(page, "mu", QUIET)
        wait(page, f"stridor.state.values.mu === {QUIET}")
        page.click("#st-cycle-go")
        wait(page, ENDED)
        expect(page.locator("#st-cycle-said")).to_have_text(f"At μ = {QUIET} no limit cycle was found.")
        expect(page.locator("#st-cycle-more summary")).to_have_text("3 motions died out")
        assert page.evaluate(LABELS) == []


@WITH_BROWSER
def test_a_case_that_cannot_be_taken_is_told_why(browser: Any, coupled: str, tmp_path: Path) -> None:
    path = tmp_path / "weakening.toml"
    path.write_text(case().with_(NEITHER | {"title": "weakening"}).to_toml(), encoding="utf-8")
    with page_at(browser, coupled) as page:
        page.set_input_files("input[type=file]", path)
        expect(page.locator("#st-title")).to_have_text("weakening")
        page.click("#st-cycle-go")
        wait(page, ENDED)
        expect(page.locator("#st-cycle-said")).to_contain_text("there are cubic springs")
        assert page.evaluate(LABELS) == []
        shot(page, "cycles-refused", full_page=True)
