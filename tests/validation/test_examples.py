"""Every example runs, finds the number that it promises, and draws the picture that the gallery shows."""

from __future__ import annotations

import ast
import runpy
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib import image
from matplotlib import pyplot as plt

mpl.use("agg")
pytestmark = pytest.mark.validation
ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PICTURES = ROOT / "docs" / "images" / "gallery"
LARGEST = 60_000  # bytes of a picture
ALIKE = 0.002  # mean difference of two pictures, of the range from black to white
# Runs through stick, slip and separation are chaotic: the last digit of a processor's additions turns a shape round.
# What such scripts find they assert in numbers that bear it.
CHAOTIC = {"paper_shapes": 0.08, "paper_in_time": 0.08, "sliding_map": 0.3}
SLOW = {
    "uneven_damping", "countermeasures", "reduction", "growth_both_ways", "what_onsets_hang_on", "paper_damping",
    "paper_all_modes", "ziegler_column", "falling_friction", "hysteresis", "parameter_study",
}  # fmt: skip
MARKED = [pytest.param(e, id=e.stem, marks=[pytest.mark.slow] if e.stem in SLOW else []) for e in EXAMPLES]


@pytest.mark.parametrize("example", MARKED)
def test_example_runs_and_draws_what_the_gallery_shows(example: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    try:
        runpy.run_path(str(example))
    finally:
        plt.close("all")
    drawn = tmp_path / f"{example.stem}.png"
    shown = PICTURES / drawn.name
    assert 5_000 < shown.stat().st_size <= LARGEST
    one, other = image.imread(drawn), image.imread(shown)
    assert one.shape == other.shape
    assert float(np.abs(one - other).mean()) < CHAOTIC.get(example.stem, ALIKE), "draw it anew: python examples/… in docs/images/gallery"


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_reads_like_a_page(example: Path):
    text = example.read_text(encoding="utf-8")
    tree = ast.parse(text)
    told = ast.get_docstring(tree)
    assert told is not None
    assert told.split("\n\n")[0].endswith((".", "?"))
    assert 15 <= len(text.splitlines()) <= 70
    # The number that is known is asserted, and nothing inside the package is used but what the documentation names.
    assert any(isinstance(node, ast.Assert) for node in ast.walk(tree))
    inner = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and "stridor" in (node.module or "")}
    assert inner <= {"stridor.case", "stridor.modal.full"}


def test_gallery_shows_each_example_once_with_its_picture():
    gallery = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")
    assert len(EXAMPLES) >= 10
    for example in EXAMPLES:
        assert gallery.count(f"../examples/{example.name}") == 1, example.name
        assert gallery.count(f"images/gallery/{example.stem}.png") == 1, example.name
    assert sorted(path.stem for path in PICTURES.iterdir()) == [example.stem for example in EXAMPLES]
