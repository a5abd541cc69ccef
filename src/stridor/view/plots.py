"""Every figure stridor draws, each from results: `st.plot.root_locus(modes)`, into your axes with `ax=`.

Each returns the matplotlib figure; it belongs to no window, so it needs no display. Notebooks show it where it is the
last line of a cell. Save it with `figure.savefig(...)`, or pass the axes of a pyplot figure of yours to see it in a
window.
"""

from .agreement_plots import growth_comparison, perturbation_growth, spectrum_map
from .field_plots import contact_map, contact_snapshot, interface_energy
from .modal_plots import damping_branches, frequency_branches, friction_curve, growth_branches, root_locus
from .problem_plots import Animation, animate, mode, model
from .shape_plots import mode_shape, model_plot, shapes_side_by_side
from .solid_plots import mesh
from .solid_plots import mode_shape as solid_mode_shape
from .temporal_plots import (
    acceleration_history,
    contact_force_and_velocity,
    contact_history,
    energy_plot,
    phase_portrait,
    spectrogram_plot,
    spectrum_plot,
)

__all__ = [
    "Animation",
    "acceleration_history",
    "animate",
    "contact_force_and_velocity",
    "contact_history",
    "contact_map",
    "contact_snapshot",
    "damping_branches",
    "energy_plot",
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
    "root_locus",
    "shapes_side_by_side",
    "solid_mode_shape",
    "spectrogram_plot",
    "spectrum_map",
    "spectrum_plot",
]
