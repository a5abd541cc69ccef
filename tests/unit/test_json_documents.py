"""Every name in a document that a verb prints with --json stands in docs/results.md, at that verb."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import stridor as st
from mode_coupling import mode_coupling
from program import stridor
from stridor.app.option_table import EVERY
from stridor.case import template_text

FEW = [
    "bodies.beam1.elements=6",
    "bodies.beam2.elements=18",
    "modal.max_frequency_hz=12e3",
    "modal.friction_range=[0.0, 0.2]",
    "modal.sweep_points=3",
    "phases.press.duration=2e-3",
    "phases.slide.duration=4e-3",
]
DAMPINGS = "--x bodies.beam1.damping.mass --y bodies.beam2.damping.mass --x-range 10:50 --y-range 10:50 --points 2"
BOUNDARY = "--x bodies.beam1.damping.mass --x-range 10:50 --y mu --y-range 0:0.2 --lines 2"
WORDS = {
    "new": ["two-beams"],
    "check": ["case.toml"],
    "export": ["case.toml", "--force"],
    "matrices": ["case.out/matrices.toml"],
    "modes": ["case.toml", "--mu", "0.1", "--band", "1000:9000"],
    "onsets": ["case.toml", "--band", "1000:9000"],
    "onsets along": ["case.toml", "--along", "bodies.beam1.thickness", "--between", "0.0014:0.0015"],
    "sensitivities": ["case.toml", "--mu", "0.2", "--band", "1000:9000"],
    "countermeasures": ["case.toml", "--mu", "0.2", "--verify", "1"],
    "damping-map": ["case.toml", *DAMPINGS.split()],
    "boundary": ["case.toml", *BOUNDARY.split()],
    "reduce": ["case.toml", "--box", "mu=0:0.3", "--at", "mu=0.1", "--onsets", "mu"],
    "cycles": ["rub.toml", "--mu", "1.0"],
    "steady": ["case.toml"],
    "shapes": ["case.toml", "--mu", "0.2"],
    "simulate": ["case.toml", "--copies", "2"],
    "compare": ["case.toml"],
    "run": ["case.toml", "--skip", "compare,report"],
    "report": ["case.toml", "--skip", "countermeasures,sensitivities"],
    "study": ["study.toml"],
    "plot": ["study.out"],
    "ensemble": ["case.toml", "--mu", "0.05,0.2", "--speed", "1,2"],
    "sound": ["run.out"],
}
STUDY = """
case = "case.toml"
parameters.mu.range = [0.0, 0.2]
parameters."bodies.beam1.damping.mass".range = [1.0, 10.0]
sampling = { method = "sobol", samples = 4 }
"""
# Tables whose keys are names of the case or of the result, not words of the document.
NAMED = {"amplitudes", "contacts", "bodies", "first_regime", "settled", "matrices", "copies", "seconds", "point", "parameters"}


def told() -> tuple[set[str], dict[str, set[str]]]:
    """Names in the documentation: in all documents, and by verb."""
    text = (Path(__file__).parents[2] / "docs" / "results.md").read_text(encoding="utf-8")
    part = text.partition("## JSON\n")[2].partition("\n## ")[0]
    general, _, verbs = part.partition("The verbs:")
    items = re.split(r"^- (?=`)", verbs, flags=re.MULTILINE)[1:]
    found: dict[str, set[str]] = {}
    for item in items:
        head, _, rest = item.partition(":")
        for verb in re.findall(r"`([\w-]+)`", head):
            found[verb] = set(re.findall(r"`(\w+)`", rest))
    return set(re.findall(r"`(\w+)`", general)), found


def names(value: Any) -> Iterator[str]:
    if isinstance(value, list):
        for item in value:
            yield from names(item)
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield key
            tables = inner.values() if key in NAMED and isinstance(inner, dict) else [inner]
            for table in tables:
                yield from names(table)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("json")
    (made / "case.toml").write_text(st.loads(template_text("two-beams"), FEW).text, encoding="utf-8")
    (made / "rub.toml").write_text(mode_coupling(0.02, 0.1).text, encoding="utf-8")
    (made / "study.toml").write_text(STUDY, encoding="utf-8")
    assert stridor("study", "study.toml", "--quiet", cwd=made).returncode == 0
    assert stridor("export", "case.toml", "--quiet", cwd=made).returncode == 0
    assert stridor("simulate", "case.toml", "--out", "run.out", "--quiet", cwd=made).returncode == 0
    return made


def test_every_verb_is_told_of() -> None:
    assert set(told()[1]) == {name.split()[0] for name in WORDS} == set(EVERY)


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] if n == "compare" else []) for n in WORDS])
def test_names_are_those_of_the_documentation(name: str, folder: Path) -> None:
    verb = name.split()[0]
    done = stridor(verb, *WORDS[name], "--json", cwd=folder)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    if verb == "matrices":
        document = list(document.values())  # by names of bodies
    if verb in ("run", "report"):
        # Documents of other verbs, told of at those.
        document = {key: None if isinstance(value, dict) and key != "seconds" else value for key, value in document.items()}
    general, verbs = told()
    found = set(names(document))
    assert found
    assert not found - general - verbs[verb]
