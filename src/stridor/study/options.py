"""What a case asks of the modal approach."""

from __future__ import annotations

from typing import Protocol

from ..case.schema import Modal
from ..modal.options import Options


class Asks(Protocol):
    """A case, or whatever else has a table [modal]."""

    @property
    def modal(self) -> Modal:
        """The table."""
        ...


def options_of(case: Asks) -> Options:
    """The effects of the steady state that [modal] counts."""
    settings = case.modal
    return Options(settings.friction_damping, settings.prestress, _chosen(settings.solver), _chosen(settings.source))


def _chosen(name: str) -> str | None:
    return None if name == "auto" else name
