"""What a case asks of the modal approach."""

from __future__ import annotations

from ..case import Case
from ..modal.options import Options


def options_of(case: Case) -> Options:
    """The effects of the steady state that the case's [modal] counts."""
    settings = case.modal
    return Options(settings.friction_damping, settings.prestress, _chosen(settings.solver), _chosen(settings.source))


def _chosen(name: str) -> str | None:
    return None if name == "auto" else name
