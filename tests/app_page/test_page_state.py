"""What a page shows as one value: changes, undo, links, the file with the changes in it; and the levers of a case."""

from __future__ import annotations

import base64
import json
import tomllib
import zlib
from dataclasses import replace
from pathlib import Path

import pytest

import stridor as st
from stridor.app.page.levers import levers
from stridor.app.page.state import (
    LARGEST_LINK,
    History,
    PageState,
    Source,
    checked,
    file_text,
    first_state,
    from_link,
    template_sources,
    to_link,
)
from stridor.case import template_text

BEAMS = Source.template("two-beams")
OWN = template_sources()


def test_a_state_is_its_case_with_changes():
    state = first_state(BEAMS).with_change("bodies.beam1.angle_deg", 80.0)
    assert state.mu == 0.1
    assert state.case().bodies["beam1"].angle_deg == 80.0
    assert checked(BEAMS).bodies["beam1"].angle_deg == 85.0


def test_the_file_has_the_changes_and_keeps_its_comments():
    state = replace(first_state(BEAMS).with_change("loads.press.force.1", -33.0), mu=0.25)
    text = file_text(state)
    case = st.loads(text)
    assert case.loads["press"].force == (0.0, -33.0)
    assert case.contacts["A"].friction.coefficient == 0.25
    assert "recovered from its frequencies" in text
    assert file_text(first_state(BEAMS)) == BEAMS.text


def test_a_law_is_scaled_with_the_friction_of_the_page():
    text = template_text("two-beams").replace(
        'friction = { law = "coulomb", coefficient = 0.1 }',
        'friction = { law = "static-kinetic", coefficient = 0.1, static_coefficient = 0.12 }',
    )
    state = replace(first_state(Source("x", text)), mu=0.2)
    law = st.loads(file_text(state)).contacts["A"].friction
    assert (law.coefficient, law.static_coefficient) == (0.2, pytest.approx(0.24))


def test_undo_and_redo_walk_along_the_states():
    first = first_state(BEAMS)
    history = History(first)
    history.go(replace(first, mu=0.2))
    history.go(replace(first, mu=0.3), together=True)  # a slider that goes on moving
    history.go(replace(first, branch=3))
    assert history.undo()
    assert history.now.mu == 0.3
    assert history.undo()
    assert history.now == first
    assert not history.undo()
    assert history.redo()
    assert history.now.mu == 0.3
    history.go(first)
    assert not history.can_redo


@pytest.mark.parametrize("source", [BEAMS, Source("mine.toml", template_text("two-beams") + "\n# mine\n")])
def test_a_link_restores_the_state(source: Source):
    state = PageState(source, {"bodies.beam1.angle_deg": 80.25}, 0.31, 7, "map")
    link = to_link(state, OWN)
    assert from_link(link, OWN) == state
    assert len(link) < (400 if source is BEAMS else LARGEST_LINK)


def packed(document: object) -> str:
    return base64.urlsafe_b64encode(zlib.compress(json.dumps(document).encode())).decode().rstrip("=")


GOOD = {"of": "template:two-beams", "changes": {}, "mu": 0.1, "branch": None, "tab": "bench"}


@pytest.mark.parametrize(
    "link",
    [
        "", "nonsense", "A" * (LARGEST_LINK + 1), packed([]), packed({**GOOD, "of": "template:none"}),
        packed({**GOOD, "mu": -1}), packed({**GOOD, "mu": "0.1"}), packed({**GOOD, "branch": "1"}),
        packed({**GOOD, "tab": "x"}), packed({**GOOD, "changes": {"a": "text"}}), packed({**GOOD, "changes": {"a": True}}),
        packed({**GOOD, "changes": {f"a{k}": 1.0 for k in range(500)}}),
        base64.urlsafe_b64encode(zlib.compress(b"0" * 20_000_000)).decode(),
    ],
)  # fmt: skip
def test_what_is_no_state_is_refused_in_one_sentence(link: str):
    with pytest.raises(st.CaseError, match=r"^link: holds no state of this page; copy it again, whole$"):
        from_link(link, OWN)


def test_the_good_link_of_these_tests_is_one():
    assert from_link(packed(GOOD), OWN) == first_state(BEAMS)


MESHED = '[materials.m]\nyoung_modulus = 1e9\ndensity = 1e3\npoisson_ratio = 0.3\n[bodies.b]\ntype = "solid"\nmaterial = "m"\nfile = "/etc/passwd"\n'


@pytest.mark.parametrize(
    ("text", "where"),
    [(MESHED, "bodies.b.file"), ('[[matrices]]\nfile = "a.mtx"\n', "matrices.0.file"),
     ('bodies = { b = { type = "matrices", mesh = "x.inp", terms = [] } }\n', "bodies.b.mesh")],
)  # fmt: skip
def test_a_case_that_a_page_was_sent_names_no_files(text: str, where: str):
    with pytest.raises(st.CaseError) as caught:
        checked(Source("sent.toml", text))
    assert str(caught.value).startswith(f"{where}: names a file of this computer, which a page does not read")


def test_a_broken_case_is_refused_in_the_words_of_the_command_line(tmp_path: Path):
    text = template_text("two-beams").replace("length = 0.05", "length = -1.0").replace('"beam1.tip"', '"beam1.tipp"')
    path = tmp_path / "broken.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(st.CaseError) as by_file:
        st.load(path)
    with pytest.raises(st.CaseError) as by_page:
        checked(Source("broken.toml", text))
    assert str(by_page.value) == str(by_file.value)
    assert "bodies.beam1.length" in str(by_page.value)


def test_a_key_that_would_take_for_ever_is_refused_before_the_text_is_read(monkeypatch: pytest.MonkeyPatch):
    """Reading 20 000 parts takes half a minute, in which the server answers nobody."""
    monkeypatch.setattr(tomllib, "loads", lambda _: pytest.fail("the text was read"))
    with pytest.raises(st.CaseError) as caught:
        checked(Source("bomb.toml", "a." * 20_000 + "a = 1"))
    assert str(caught.value) == "bomb.toml, line 1: a key of tables that are nested too deeply"


def test_the_levers_of_the_two_beams():
    found = {lever.path: lever for lever in levers(checked(BEAMS))}
    assert list(found)[:5] == [
        "bodies.beam1.angle_deg", "bodies.beam1.start.0", "contacts.A.stiffness", "loads.press.force.1",
        "supports.clamp.velocity.x",
    ]  # fmt: skip
    assert found["contacts.A.stiffness"].scale == "log"
    assert found["bodies.beam1.start.0"].high < 0.15
    assert {found[p].unit for p in ("bodies.beam1.angle_deg", "loads.press.force.1", "materials.steel.density")} == {"°", "N", "kg/m³"}
    assert all(lever.low < lever.value < lever.high for lever in found.values())


def test_every_lever_moves_its_case():
    case = checked(BEAMS)
    for lever in levers(case):
        moved = PageState(BEAMS, {lever.path: lever.value + 0.01 * (lever.high - lever.low)}).case()
        assert moved != case, lever.path


def test_the_pad_on_the_disc_has_its_levers():
    found = {lever.path for lever in levers(checked(Source.template("pad-on-disc")))}
    assert {"contacts.face.stiffness", "loads.piston.pressure"} <= found


def test_a_link_to_a_file_of_the_server_is_to_its_text_not_its_name():
    mine, other = (Source("case.toml", template_text(name), "/somewhere") for name in ("two-beams", "pad-on-disc"))
    link = to_link(first_state(mine), {mine.key: mine})
    assert len(link) < 200
    assert from_link(link, {mine.key: mine, other.key: other}).source == mine
    with pytest.raises(st.CaseError, match="holds no state of this page"):
        from_link(link, {other.key: other})


def test_a_shape_of_another_model_is_not_that_of_the_page():
    """Its eigenvalue would be sought in the full problem of a case that never had it."""
    pytest.importorskip("nicegui", reason="the extra app is not installed")
    from stridor.app.page.panel_mode import is_of

    state = replace(first_state(Source.template("two-beams")), mu=0.3, branch=8)
    shape = {"branch": 8, "mu": 0.3, "stamp": state.stamp, "growth_rate": 1.0, "frequency_hz": 8640.0}
    assert is_of(shape, state)
    for other in (replace(state, mu=0.2), replace(state, branch=7), state.with_change("materials.steel.density", 7900.0)):
        assert not is_of(shape, other)
    assert not is_of({"branch": 8, "missing": "not in the band"}, state)


def test_a_file_that_is_no_case_is_told_what_one_is() -> None:
    """What the picker rejects may be a small picture: its size alone says nothing."""
    from stridor.app.page.layout import TOO_LARGE

    assert "TOML" in TOO_LARGE
    assert "at most 5 MB" in TOO_LARGE
