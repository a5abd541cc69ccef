"""stridor: will these sliding bodies squeal, at which frequency, from which friction on, and what then?

    import stridor as st

    case = st.load("two-beams.toml")
    st.onsets(case)              # every critical friction coefficient, solved
    st.modes(case, mu=0.1)       # complex modes, branches followed from μ = 0
    st.simulate(case)            # explicit dynamics with unregularised Coulomb friction
    st.cycles(case)              # what it then swings in: limit cycles, followed over friction
    st.compare(case)             # do both approaches agree?
    st.run(case, "out")          # all of it, and a report

Names are imported when first used, so that ``import stridor`` costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from time import time_ns
from typing import TYPE_CHECKING, Any

from .errors import AnalysisError, CaseError, StridorError

if TYPE_CHECKING:
    from . import case as case
    from . import view as plot
    from .app.page import app
    from .app.pipeline import report, run
    from .case import Case, load, loads
    from .io.datasets import open, save, to_dataset
    from .io.export import export
    from .studies.plots import study_figures
    from .studies.result import open_study
    from .studies.run import run_study
    from .studies.schema import Study
    from .study.analyses import (
        body_modes,
        describe,
        friction_curve,
        modes,
        onsets,
        simulate,
        steady_sliding,
        summarise,
    )
    from .study.boundary import stability_boundary
    from .study.comparison import compare
    from .study.copies import perturbed_copies
    from .study.countermeasures import rank_countermeasures
    from .study.cycles import cycles
    from .study.damping_map import damping_map
    from .study.ensemble import ensemble
    from .study.pencil import pencil
    from .study.reduced import reduced_model
    from .study.sensitivities import sensitivities
    from .study.workspace import Workspace
    from .system import System, build_system
    from .view.sound import sound

_HOMES = {
    "Case": ".case",
    "Study": ".studies.schema",
    "System": ".system",
    "Workspace": ".study.workspace",
    "app": ".app",
    "body_modes": ".study.analyses",
    "build_system": ".system",
    "case": ".case",
    "compare": ".study.comparison",
    "cycles": ".study.cycles",
    "damping_map": ".study.damping_map",
    "describe": ".study.analyses",
    "ensemble": ".study.ensemble",
    "export": ".io.export",
    "friction_curve": ".study.analyses",
    "load": ".case",
    "loads": ".case",
    "modes": ".study.analyses",
    "onsets": ".study.analyses",
    "open": ".io.datasets",
    "open_study": ".studies.result",
    "pencil": ".study.pencil",
    "perturbed_copies": ".study.copies",
    "plot": ".view",
    "rank_countermeasures": ".study.countermeasures",
    "reduced_model": ".study.reduced",
    "report": ".app.pipeline",
    "run": ".app.pipeline",
    "run_study": ".studies.run",
    "save": ".io.datasets",
    "sensitivities": ".study.sensitivities",
    "simulate": ".study.analyses",
    "sound": ".view.sound",
    "stability_boundary": ".study.boundary",
    "steady_sliding": ".study.analyses",
    "study_figures": ".studies.plots",
    "summarise": ".study.analyses",
    "to_dataset": ".io.datasets",
}

_MODULES = ("app", "case", "plot")  # of _HOMES what is a module itself; the rest are names in one

STARTED_NS = time_ns()  # sources written later are not those that this process runs
__version__ = "0.1.0"
__all__ = [
    "AnalysisError",
    "Case",
    "CaseError",
    "StridorError",
    "Study",
    "System",
    "Workspace",
    "app",
    "body_modes",
    "build_system",
    "compare",
    "cycles",
    "damping_map",
    "describe",
    "ensemble",
    "export",
    "friction_curve",
    "load",
    "loads",
    "modes",
    "onsets",
    "open",
    "open_study",
    "pencil",
    "perturbed_copies",
    "plot",
    "rank_countermeasures",
    "reduced_model",
    "report",
    "run",
    "run_study",
    "save",
    "sensitivities",
    "simulate",
    "sound",
    "stability_boundary",
    "steady_sliding",
    "study_figures",
    "summarise",
    "to_dataset",
]


def __getattr__(name: str) -> Any:
    home = _HOMES.get(name)
    if home is None:
        raise AttributeError(f"module 'stridor' has no attribute {name!r}")
    module = import_module(home, __name__)
    return module if name in _MODULES else getattr(module, name)


def __dir__() -> list[str]:
    return sorted(__all__)
