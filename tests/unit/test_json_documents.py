"""Every name in a document that a verb prints with --json stands in docs/results.md, at that verb."""

from __future__ import annotations

from collections.abc import Generator
from pathlib import Path

import pytest

import stridor as st
from documented import assert_told, told_names
from program import stridor
from stridor.app.option_table import EVERY
from stridor.case import template_text
from stridor.temporal.attractor import NAMES as AVERAGES
from stridor.temporal.energy import SKEW
from undrawn import nothing_drawn

FEW = [
    "bodies.beam1.elements=6",
    "bodies.beam2.elements=18",
    "modal.max_frequency_hz=12e3",
    "modal.friction_range=[0.0, 0.2]",
    "modal.sweep_points=3",
    "phases.press.duration=2e-3",
    "phases.slide.duration=4e-3",
]
WORDS = {
    "new": ["two-beams"],
    "check": ["case.toml"],
    "export": ["case.toml", "--force"],
    "matrices": ["case.out/matrices.toml"],
    "modes": ["case.toml", "--mu", "0.1", "--band", "1000:9000"],
    "onsets": ["case.toml", "--band", "1000:9000"],
    "sensitivities": ["case.toml", "--mu", "0.2", "--band", "1000:9000"],
    "steady": ["case.toml"],
    "shapes": ["case.toml", "--mu", "0.2"],
    "simulate": ["case.toml", "--copies", "2"],
    "compare": ["case.toml"],
    "run": ["case.toml", "--skip", "compare,report"],
    "report": ["case.toml", "--skip", "countermeasures,sensitivities"],
    "study": ["study.toml"],
    "plot": ["study.out"],
    "sound": ["run.out"],
}
OF_TABLES = {"countermeasures", "damping-map", "boundary", "reduce", "cycles", "ensemble"}  # run by test_csv_files.py
STUDY = """
case = "case.toml"
parameters.mu.range = [0.0, 0.2]
parameters."bodies.beam1.damping.mass".range = [1.0, 10.0]
sampling = { method = "sobol", samples = 4 }
"""


@pytest.fixture(scope="module", autouse=True)
def no_pictures() -> Generator[None]:
    with nothing_drawn():
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("json")
    (made / "case.toml").write_text(st.loads(template_text("two-beams"), FEW).text, encoding="utf-8")
    (made / "study.toml").write_text(STUDY, encoding="utf-8")
    assert stridor("study", "study.toml", "--quiet", cwd=made).returncode == 0
    assert stridor("export", "case.toml", "--quiet", cwd=made).returncode == 0
    assert stridor("simulate", "case.toml", "--out", "run.out", "--quiet", cwd=made).returncode == 0
    return made


def test_every_verb_is_told_of() -> None:
    assert set(told_names()[1]) == {name.split()[0] for name in WORDS} | OF_TABLES == set(EVERY)


def test_names_that_only_some_runs_have_are_told_of() -> None:
    """Averages are of contacts that have separated, works of skew parts of matrices that are not symmetric: the case of
    the test below has neither."""
    assert {*AVERAGES, *SKEW} <= told_names()[1]["simulate"]


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n == "compare" else []) for n in WORDS])
def test_names_are_those_of_the_documentation(name: str, folder: Path) -> None:
    verb = name.split()[0]
    done = stridor(verb, *WORDS[name], "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    assert_told(verb, done.stdout)
