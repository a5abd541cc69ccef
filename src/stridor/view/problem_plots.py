"""Pictures of whatever names a problem: the model as it stands, one of its modes, that mode in motion."""

from __future__ import annotations

from dataclasses import dataclass
from html import escape
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ..errors import CaseError, kind_of
from ..modal.branch import Branch
from ..notebook import Shown
from ..study.workspace import Problem, Workspace
from ..system import System
from ..typing import ComplexArray
from .animation import animation_html
from .shape_plots import model_plot
from .solid_plots import VIEW, mesh, mode_shape

HEIGHT = 620  # pixels of a page in a notebook


@dataclass(frozen=True, repr=False)
class Animation(Shown):
    """A mode in motion: a page that plays it and needs nothing else; notebooks show it. Drag turns, the wheel zooms."""

    title: str
    html: str

    @property
    def _line(self) -> str:
        return f"{self.title}, a page of {len(self.html) / 1e6:.2g} MB"

    def _repr_html_(self) -> str:
        return (
            f'<iframe title="{escape(self.title)}" srcdoc="{escape(self.html)}" sandbox="allow-scripts" '
            f'style="width: 100%; height: {HEIGHT}px; border: 0"></iframe>'
        )

    def save(self, path: str | Path) -> Path:
        """Write the page, for a browser."""
        target = Path(path)
        target.write_text(self.html, encoding="utf-8")
        return target


def model(problem: Problem, *, ax: Axes | None = None, view: tuple[float, float] = VIEW) -> Figure:
    """The model as it stands, of a case, the path of its file, a system or a workspace: beams with supports, loads and
    contacts, meshed bodies with their mesh and the slave nodes.

    ``view``: elevation and azimuth of the line of sight [degrees], in space. Raises CaseError where nothing has a
    place.
    """
    work = Workspace.of(problem)
    system = work.system()
    if system.lines and not any(solid.cells.keys() - {"vertex"} for solid in system.solids):
        return model_plot(system, work.given, ax=ax)
    return mesh(system, ax=ax, view=view)


def mode(
    problem: Problem,
    branch: Branch,
    *,
    mu: float | None = None,
    ax: Axes | None = None,
    scale: float | None = None,
    view: tuple[float, float] = VIEW,
) -> Figure:
    """A mode of a problem where its motion is largest, in the plane or in space: ``st.plot.mode(case, modes[7])``.

    branch: an item of `modes(…, vectors="right")`; of several μ that at ``mu`` (default: where it grows fastest).
    ``scale`` multiplies displacements, otherwise they are scaled to be seen. Raises CaseError for a mode without its
    vector, and for one of another problem.
    """
    system, vector, frequency, growth = _moving(problem, branch, mu)
    return mode_shape(system, vector, ax=ax, frequency_hz=frequency, growth_rate=growth, scale=scale, view=view)


def animate(problem: Problem, branch: Branch, *, mu: float | None = None, scale: float | None = None) -> Animation:
    """A mode in motion, as `mode` takes it: shown where it is the last line of a cell, or saved as a page."""
    system, vector, frequency, growth = _moving(problem, branch, mu)
    page = animation_html(system, vector, frequency_hz=frequency, growth_rate=growth, scale=scale)
    return Animation(f"Mode {branch.number} at {frequency:.6g} Hz", page)


def _moving(problem: Problem, branch: Branch, mu: float | None) -> tuple[System, ComplexArray, float, float]:
    """The system, the vector (n,), frequency [Hz] and growth [1/s] of a mode at one μ."""
    if not isinstance(branch, Branch):  # pyright: ignore[reportUnnecessaryIsInstance]
        accepted = 'a mode: an item of st.modes(…, vectors="right"), such as modes[0]'
        raise CaseError("branch", kind_of(branch), accepted)
    if branch.right is None:
        raise CaseError("branch", None, 'the mode has no vector: ask for modes with vectors="right"')
    known = np.flatnonzero(np.isfinite(branch.eigenvalues))
    if not len(known):
        raise CaseError("branch", branch.number, "not known at any of the friction coefficients")
    if mu is None:
        row = int(known[np.argmax(branch.growth_rate[known])])
    else:
        row = int(known[np.argmin(np.abs(branch.mu[known] - mu))])
    system = Workspace.of(problem).system(float(branch.mu[row]))
    return system, branch.right[row], float(branch.frequency_hz[row]), float(branch.growth_rate[row])
