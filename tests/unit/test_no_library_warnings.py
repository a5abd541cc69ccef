"""No warning of a library reaches a user: every verb on small cases with all warnings as errors, to the end of the
process."""

from __future__ import annotations

import os
import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest
from matplotlib.tri import Triangulation

import stridor
from stridor.case import loads, template_text
from stridor.direct.dense import lu_factors
from stridor.view.field_plots import without_flat

PAD = [
    "bodies.disc.mesh.divisions=[2,16,1]",
    "bodies.lining.mesh.divisions=[2,4,1]",
    "bodies.plate.mesh.divisions=[2,3,1]",
    "phases.slide.duration=2e-5",
    "modal.max_frequency_hz=2000.0",
    "modal.sweep_points=3",
]
BEAMS = [
    "bodies.beam1.elements=6",
    "bodies.beam2.elements=9",
    "phases.press.duration=2e-4",
    "phases.slide.duration=2e-4",
    "temporal.step=1e-7",
    'temporal.watch=["beam1.tip"]',
    "modal.sweep_points=3",
    "comparison.critical=false",
]
VERBS = {
    "check": [],
    "export": [],
    "steady": [],
    "modes": [],
    "shapes": [],
    "onsets": [],
    "simulate": [],
    "sensitivities": ["--mu", "0.5"],
    "countermeasures": ["--mu", "0.5", "--verify", "1"],
    "reduce": ["--box", "mu=0:0.5", "--at", "mu=0.2", "--corrections", "0"],
    "compare": ["--mu", "0.4"],
    "damping-map": ["--x", "bodies.beam1.damping.mass", "--y", "bodies.beam2.damping.mass", "--x-range", "0:5",
                    "--y-range", "0:5", "--points", "2"],
    "boundary": ["--x", "bodies.beam1.damping.mass", "--x-range", "0:5", "--y", "mu", "--y-range", "0:0.5", "--lines", "2"],
    "cycles": ["--mu", "0.01", "--push", "1e-4"],
    "ensemble": ["--mu", "0.4,0.5", "--sweep", "both", "--set", "temporal.record_every=5"],
    "run": [],
}
# One process for several verbs: what counts is that nothing is said, also as it ends.
SCRIPT = """
import sys
from stridor.app.cli import app
for verb in sys.argv[2].split(";"):
    name, *rest = verb.split()
    try:
        app([name, sys.argv[1], *rest, "--quiet", "--out", "out"], standalone_mode=False)
    except BaseException as error:
        print(f"{name}: {type(error).__name__}: {error}", file=sys.stderr)
"""


@pytest.mark.parametrize(
    ("template", "changes", "left_out"),
    [
        pytest.param("two-beams", BEAMS, (), marks=pytest.mark.slow),
        pytest.param("pad-on-disc", PAD, ("compare", "run", "cycles", "damping-map", "ensemble", "boundary"), marks=pytest.mark.slow),
    ],
)
def test_every_verb_is_silent(tmp_path: Path, template: str, changes: list[str], left_out: tuple[str, ...]) -> None:
    (tmp_path / "case.toml").write_text(loads(template_text(template), changes).text, encoding="utf-8")
    verbs = ";".join(" ".join([verb, *rest]) for verb, rest in VERBS.items() if verb not in left_out)
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", SCRIPT, "case.toml", verbs],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=900,
        check=False,
        env={**os.environ, "MPLBACKEND": "agg", "OPENBLAS_NUM_THREADS": "1"},
    )
    assert (done.returncode, done.stderr) == (0, "")


def triangles(points: np.ndarray) -> tuple[np.ndarray, Triangulation]:
    made = Triangulation(*points.T)
    return points[made.triangles], made


def test_flat_triangles_at_a_border_are_left_out_without_a_word() -> None:
    """Nodes round a circle and on straight rows: Delaunay's triangles between nearly collinear nodes are as flat as
    rounding lets them be, and Heron's formula takes the root of what it makes negative there."""
    rng = np.random.default_rng(3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for angle in np.linspace(0.1, 1.4, 40):
            grid = np.stack(np.meshgrid(np.linspace(0.0, 1.0, 7), np.linspace(0.0, 0.3, 4)), axis=-1).reshape(-1, 2)
            turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
            corners, made = triangles((grid + 1e-17 * rng.standard_normal(grid.shape)) @ turn.T + 0.1)
            gone = without_flat(corners, made.neighbors, np.zeros(len(corners), dtype=bool), 0.05)
            first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
            area = 0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
            # What is left covers the rectangle, and nothing flat is at its border.
            assert area[~gone].sum() == pytest.approx(0.3, rel=1e-9)
            assert area[~gone].min() > 1e-3


def test_a_flat_triangle_inside_stays() -> None:
    """Only from the border inwards: a hole in the middle of a picture would be worse."""
    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.5, 0.5], [0.5, 0.5 + 1e-4]])
    corners, made = triangles(points)
    gone = without_flat(corners, made.neighbors, np.zeros(len(corners), dtype=bool), 0.05)
    assert not gone.any()


def test_singular_matrices_give_no_warning_of_scipy() -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        factors, _ = lu_factors(np.zeros((2, 2)))
    assert not np.diag(factors).any()
    # What warns is called in one place.
    package = Path(stridor.__file__).parent
    callers = [path.name for path in package.rglob("*.py") if "sl.lu_factor(" in path.read_text(encoding="utf-8")]
    assert callers == ["dense.py"]
