"""A case takes the place of the one on the page once its model is built, and not where that is refused."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from typing import Any

import pytest
from page_programs import HUGE_CASE

from stridor.app.page.bench import Bench
from stridor.app.page.session import Session
from stridor.app.page.state import Source, first_state, template_sources, to_link
from stridor.case import template_text

BEAMS = Source.template("two-beams")
OTHER = Source("other.toml", template_text("two-beams") + "\n# other\n")
HUGE = Source("huge.toml", HUGE_CASE)


class Asked:
    """In place of the process of a page: what it is asked."""

    def __init__(self, *_: Any) -> None:
        self.questions: list[Any] = []

    def ask(self, question: Any) -> int:
        self.questions.append(question)
        return len(self.questions)

    def close(self) -> None:
        pass

    end = close


class Page:
    """A page after a move, and what is told of it."""

    def __init__(self) -> None:
        self.session = Session(BEAMS, template_sources(), lambda call, *given: call(*given))
        self.worker: Any = self.session._worker
        self.session.move("contacts.A.stiffness", 2e10)
        self.hear(1, "at", {"mu": 0.1})
        self.hear(1, "done", None)
        self.before = self.session.state
        self.told: list[tuple[str, Any]] = []
        self.changes: list[Source] = []
        self.session.on_picture(lambda part, content: self.told.append((part, content)))
        self.session.on_change(lambda: self.changes.append(self.session.state.source))

    def hear(self, number: int, part: str, content: Any) -> None:
        self.session._heard(number, part, content)


@pytest.fixture
def page(monkeypatch: pytest.MonkeyPatch) -> Generator[Page]:
    monkeypatch.setattr("stridor.app.page.session.Worker", Asked)
    made = Page()
    yield made
    made.session.close()
    made.session.end()


@pytest.mark.parametrize(("part", "said"), [("refused", "too many"), ("failed", "huge.toml was not opened: too many")])
def test_a_case_whose_model_is_refused_leaves_the_page_as_it_is(page: Page, part: str, said: str):
    session = page.session
    link = session.link()
    session.open(HUGE)
    assert (session.state, page.changes, session.picture.busy) == (page.before, [], True)
    page.hear(2, part, "too many")
    page.hear(2, "done", None)
    assert (session.state, session.link(), session.picture.parts) == (page.before, link, {"at": {"mu": 0.1}})
    assert page.told[-1] == ("declined", said)
    assert session.picture.problem == ""  # of the numbers that are shown nothing is refused
    assert page.worker.questions[-1] == page.before  # its process has turned to the other case meanwhile
    session.undo()
    assert session.state == first_state(BEAMS)
    session.move("mu", 0.2)
    assert page.worker.questions[-1] == replace(first_state(BEAMS), mu=0.2)


def test_a_case_comes_with_the_first_of_its_picture(page: Page):
    session = page.session
    session.open(OTHER)
    assert page.told == [("progress", {"what": "other.toml is being opened"})]
    session.look("map")
    page.hear(2, "locus", {"mu": []})
    assert (session.state.source, session.state.tab, session.picture.parts) == (OTHER, "map", {"locus": {"mu": []}})
    assert page.changes == [BEAMS, OTHER]
    assert page.told[1:] == [("progress", {"what": ""}), ("locus", {"mu": []})]
    assert len(page.worker.questions) == 2  # nothing is asked for twice
    session.undo()
    assert session.state == replace(page.before, tab="map")


def test_what_is_asked_for_meanwhile_wins_and_is_told(page: Page):
    session = page.session
    session.open(OTHER)
    session.move("mu", 0.2)
    said = "other.toml was not opened: something else was asked for before its model was built"
    assert page.told[-1] == ("declined", said)
    page.hear(2, "locus", "of the other case")
    assert session.state == replace(page.before, mu=0.2)
    assert "locus" not in session.picture.parts
    assert ("locus", "of the other case") not in page.told
    page.hear(3, "at", {"mu": 0.2})
    assert session.picture.parts["at"] == {"mu": 0.2}


def test_of_two_cases_the_newer_is_opened(page: Page):
    session = page.session
    session.open(HUGE)
    session.open(OTHER)
    page.hear(2, "refused", "too many")
    page.hear(3, "model", {})
    assert session.state.source == OTHER
    assert not [part for part, _ in page.told if part == "declined"]
    session.open(BEAMS)
    session.open(OTHER)  # the one that is there
    page.hear(4, "model", {})
    assert session.state.source == OTHER
    assert page.worker.questions[-1] == session.state


def test_a_link_to_a_case_whose_model_is_refused_leaves_the_page_as_it_is(page: Page):
    session = page.session
    session.restore(to_link(first_state(HUGE), template_sources()))
    page.hear(2, "refused", "too many")
    assert session.state == page.before
    assert page.changes == [BEAMS]  # a page that has just been opened draws its own case now
    session.restore(to_link(replace(page.before, mu=0.4), template_sources()))
    assert session.state.mu == 0.4


def test_a_model_that_is_too_large_is_refused_with_the_first_word_of_the_answer():
    found: list[tuple[str, Any]] = []
    Bench()(first_state(HUGE), lambda part, content: found.append((part, content)))
    ((part, content),) = found
    assert part == "refused"
    assert content.startswith("bodies.b.mesh.divisions: [100000, 100000] – makes 6.0e+10 degrees of freedom")
