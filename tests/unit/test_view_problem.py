"""Pictures of problems by whatever names them, and what a notebook without any setting shows of figures."""

from __future__ import annotations

import html
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import stridor as st
from stridor.app.arguments import Call
from stridor.case import template_text

CUBE = """
materials.steel = { young_modulus = 200e9, density = 7800.0 }
[bodies.cube]
type = "solid"
material = "steel"
model = "3d"
mesh = { shape = "block", corner = [0.0, 0.0, 0.0], size = [0.02, 0.02, 0.02], divisions = [2, 2, 2] }
[supports.floor]
at = "cube.bottom"
fixed = ["x", "y", "z"]
[modal]
max_frequency_hz = 60e3
"""
PNG = b"\x89PNG\r\n\x1a\n"


@pytest.fixture(params=["beams", "cube"])
def file(request: pytest.FixtureRequest, tmp_path: Path) -> Path:
    path = tmp_path / f"{request.param}.toml"
    path.write_text(CUBE if request.param == "cube" else template_text("two-beams"), encoding="utf-8")
    return path


def test_models_and_modes_in_the_plane_and_in_space(file: Path) -> None:
    case = st.load(file)
    others = (case, st.build_system(case), st.Workspace(case)) if case.contacts else ()  # in space each takes a while
    for problem in (str(file), *others):
        assert st.plot.model(problem)._repr_png_().startswith(PNG)
    modes = st.modes(case, 0.2 if case.contacts else 0.0, vectors="right")
    figure = st.plot.mode(case, modes[0])
    assert f"{modes.frequency_hz[0, 0]:.0f}"[:2] in figure.axes[0].get_title("left").replace(".", "")
    moving = st.plot.animate(case, modes[0])
    shown = moving._repr_html_()
    assert shown.startswith("<iframe ")
    assert moving.html in html.unescape(shown)
    assert "requestAnimationFrame" in moving.html
    assert len(repr(moving)) < 100
    assert moving.save(file.with_suffix(".html")).read_text(encoding="utf-8") == moving.html


def test_of_several_coefficients_the_one_asked_for_or_the_fastest() -> None:
    case = st.loads(template_text("two-beams"))
    modes = st.modes(case, [0.05, 0.2, 0.1], vectors="right")
    grows = max(modes, key=lambda branch: branch.growth_rate.max())
    titles = [st.plot.mode(case, grows, mu=mu).axes[0].get_title("left") for mu in (None, 0.2, 0.05)]
    assert titles[0] == titles[1] != titles[2]
    assert "unstable" in titles[0]


def test_what_is_no_mode_is_told() -> None:
    case = st.loads(template_text("two-beams"))
    modes = st.modes(case, 0.1)
    for branch, said in (
        (modes[0], 'branch: the mode has no vector: ask for modes with vectors="right"'),
        (8, "branch: 'an int' – a mode: an item of st.modes(…, vectors=\"right\"), such as modes[0]"),
    ):
        with pytest.raises(st.CaseError) as told:
            st.plot.animate(case, branch)
        assert str(told.value) == said
    with pytest.raises(st.CaseError, match=r"accepted|length|freedoms|values"):
        st.plot.animate(st.loads(CUBE), st.modes(case, 0.1, vectors="right")[0])


def test_every_figure_shows_itself_and_no_window_is_asked_for() -> None:
    program = (
        "import sys, stridor as st; from stridor.case import template_text\n"
        "case = st.loads(template_text('two-beams'), ['bodies.beam1.elements=3', 'bodies.beam2.elements=6'])\n"
        "figure = st.plot.root_locus(st.modes(case, [0.0, 0.1, 0.2]))\n"
        "sys.stdout.buffer.write(figure._repr_png_()[:8])\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=True)
    assert done.stdout == PNG


def test_axes_that_are_given_keep_their_figure() -> None:
    own = Figure()
    ax = own.subplots()
    assert st.plot.model(st.loads(template_text("two-beams")), ax=ax) is own
    assert np.isfinite(ax.get_xlim()).all()


def test_a_verb_draws_its_figure_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure that is not laid out yet is drawn in vain before."""
    drawn: list[Figure] = []
    draw = Figure.draw
    monkeypatch.setattr(Figure, "draw", lambda self, renderer: drawn.append(self) or draw(self, renderer))
    figure = st.plot.model(st.loads(template_text("two-beams")))
    path = Call(tmp_path / "case.toml", tmp_path, None, None, json=False, quiet=True).draw(figure, "model.png")
    assert path.read_bytes().startswith(PNG)
    assert drawn == [figure]
