"""Figures and reports of results. Takes results, computes no physics; matplotlib is loaded at first use.

`from stridor.view import plots` for figures (`plots.root_locus(modes, ax=ax)`), `write_report` for the page.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import plots
    from .boundary_plots import stability_boundary
    from .cycle_plots import cycle_branches, cycle_period
    from .ensemble_plots import ensemble_map
    from .inputs import FrictionCurve, NamedFrequencies, NamedShape, ReportInputs
    from .plots import (
        Animation,
        acceleration_history,
        animate,
        contact_force_and_velocity,
        contact_history,
        contact_map,
        contact_snapshot,
        damping_branches,
        energy_plot,
        frequency_branches,
        friction_curve,
        growth_branches,
        growth_comparison,
        interface_energy,
        mesh,
        mode,
        mode_shape,
        model,
        model_plot,
        perturbation_growth,
        phase_portrait,
        root_locus,
        shapes_side_by_side,
        solid_mode_shape,
        spectrogram_plot,
        spectrum_map,
        spectrum_plot,
    )
    from .report import write_report
    from .sensitivity_plots import countermeasure_bars, damping_map, sensitivity_bars

__all__ = [
    "Animation",
    "FrictionCurve",
    "NamedFrequencies",
    "NamedShape",
    "ReportInputs",
    "acceleration_history",
    "animate",
    "contact_force_and_velocity",
    "contact_history",
    "contact_map",
    "contact_snapshot",
    "countermeasure_bars",
    "cycle_branches",
    "cycle_period",
    "damping_branches",
    "damping_map",
    "energy_plot",
    "ensemble_map",
    "frequency_branches",
    "friction_curve",
    "growth_branches",
    "growth_comparison",
    "interface_energy",
    "mesh",
    "mode",
    "mode_shape",
    "model",
    "model_plot",
    "perturbation_growth",
    "phase_portrait",
    "plots",
    "root_locus",
    "sensitivity_bars",
    "shapes_side_by_side",
    "solid_mode_shape",
    "spectrogram_plot",
    "spectrum_map",
    "spectrum_plot",
    "stability_boundary",
    "write_report",
]

_HOME = {
    "NamedFrequencies": "inputs",
    "FrictionCurve": "inputs",
    "NamedShape": "inputs",
    "ReportInputs": "inputs",
    "countermeasure_bars": "sensitivity_plots",
    "damping_map": "sensitivity_plots",
    "ensemble_map": "ensemble_plots",
    "sensitivity_bars": "sensitivity_plots",
    "stability_boundary": "boundary_plots",
    "cycle_branches": "cycle_plots",
    "cycle_period": "cycle_plots",
    "write_report": "report",
}


def __getattr__(name: str) -> object:
    """What is asked for, its module loaded only then."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    if name == "plots":
        return import_module(".plots", __name__)
    return getattr(import_module(f".{_HOME.get(name, 'plots')}", __name__), name)


def __dir__() -> list[str]:
    return __all__
