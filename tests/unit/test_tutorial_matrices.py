"""The tutorial on matrices, followed from its first line to its last: files written, commands run, numbers compared."""

from __future__ import annotations

import re
import shutil

import numpy as np
import pytest

import stridor as st
from pages import ROOT, Page
from rubbing_block import rubbing_block
from stridor.modal.onset import Onsets

DOCS = ROOT / "docs"
pytestmark = pytest.mark.slow  # as other long pages: weekly


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> Page:
    """Everything that was done, what each command printed, and what its Python has."""
    folder = tmp_path_factory.mktemp("tutorial")
    for file in (DOCS / "tutorial-matrices").iterdir():
        shutil.copy(file, folder)
    page = Page(DOCS / "tutorial-matrices.md", folder, slow=False).follow()
    assert "note" not in page.warned
    return page


def test_every_command_is_run(followed: Page) -> None:
    verbs = [command.split()[1] for command in followed.printed]
    assert verbs == ["new", "export", "matrices", "modes", "sensitivities", "countermeasures", "modes", "export", "onsets", "modes", "check", "onsets"]


def test_what_the_text_says(followed: Page) -> None:
    printed = followed.printed
    assert "K − Kᵀ has rank 2" in printed["stridor matrices brake.toml"]
    growing = [line.split() for line in printed["stridor modes brake.toml"].splitlines() if "  unstable" in line]
    assert [words[1] for words in growing] == ["8667.05"]
    # Without places of nodes there is no shape to draw.
    assert "Next: stridor report brake.toml" in printed["stridor modes brake.toml"]
    whirling = printed["stridor modes rotor.toml --set parameters.Omega.value=100"]
    for frequency in (50 - 100 / (2 * np.pi), 50 + 100 / (2 * np.pi)):
        assert f"{frequency:.4f}" in whirling
    complete = " ".join((DOCS / "tutorial-matrices.md").read_text(encoding="utf-8").split())
    onsets = followed.names["onsets"]
    assert isinstance(onsets, Onsets)
    sentence = onsets.completeness
    assert re.sub(r"\d+ unknowns", "", sentence) in re.sub(r"\d+ unknowns", "", complete)


def test_both_ways_give_the_same(followed: Page) -> None:
    folder = followed.folder

    def onsets(case: str | st.Case) -> np.ndarray:
        found = st.onsets(case if isinstance(case, st.Case) else st.load(folder / case)).onsets
        assert found
        return np.array([(o.mu, o.frequency_hz) for o in found])

    own = onsets("two-beams.toml")
    for imported in ("squeal.toml", "squeal/matrices.toml"):
        assert onsets(imported) == pytest.approx(own, rel=1e-9)
    meshed = st.loads(rubbing_block("max_frequency_hz = 30e3"))
    assert onsets("caliper.toml") == pytest.approx(onsets(meshed), rel=1e-9)
