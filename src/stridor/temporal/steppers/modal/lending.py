"""Every array of the loop, borrowed: see ``borrow``."""

from __future__ import annotations

from ....kernels import njit
from .borrow import borrow
from .layout import Fields, ModalRows, NodalRows, Record
from .operators import ContactArrays, ModalArrays, NodalArrays
from .stage import Forcing, LoopState, Scratch


@njit(cache=True, inline="always")
def lent_modal(x: ModalArrays) -> ModalArrays:  # pragma: no cover - compiled
    """The same ModalArrays, its arrays borrowed."""
    return ModalArrays(
        borrow(x.forward), borrow(x.restore), borrow(x.drive), borrow(x.damping), borrow(x.stiffness), borrow(x.blocks)
    )


@njit(cache=True, inline="always")
def lent_nodal(x: NodalArrays) -> NodalArrays:  # pragma: no cover - compiled
    """The same NodalArrays, its arrays borrowed."""
    return NodalArrays(
        borrow(x.k_ptr),
        borrow(x.k_col),
        borrow(x.k_val),
        borrow(x.m_ptr),
        borrow(x.m_col),
        borrow(x.m_val),
        borrow(x.c_ptr),
        borrow(x.c_col),
        borrow(x.c_val),
        borrow(x.factor),
        x.load_gain,
    )


@njit(cache=True, inline="always")
def lent_modal_rows(x: ModalRows) -> ModalRows:  # pragma: no cover - compiled
    """The same ModalRows, its arrays borrowed."""
    return ModalRows(borrow(x.values), borrow(x.met), borrow(x.at))


@njit(cache=True, inline="always")
def lent_nodal_rows(x: NodalRows) -> NodalRows:  # pragma: no cover - compiled
    """The same NodalRows, its arrays borrowed."""
    return NodalRows(borrow(x.ptr), borrow(x.col), borrow(x.val), borrow(x.answers), borrow(x.auxiliary))


@njit(cache=True, inline="always")
def lent_contacts(x: ContactArrays) -> ContactArrays:  # pragma: no cover - compiled
    """The same ContactArrays, its arrays borrowed."""
    return ContactArrays(
        borrow(x.kind),
        borrow(x.base),
        borrow(x.friction),
        borrow(x.gap),
        borrow(x.table),
        borrow(x.nodes_at),
        borrow(x.nodes),
        borrow(x.chords),
        borrow(x.slave),
        borrow(x.side),
        borrow(x.kept),
        borrow(x.compliance),
    )


@njit(cache=True, inline="always")
def lent_forcing(x: Forcing) -> Forcing:  # pragma: no cover - compiled
    """The same Forcing, its arrays borrowed."""
    return Forcing(
        borrow(x.loads),
        borrow(x.increments),
        borrow(x.mass_own),
        borrow(x.damping_own),
        borrow(x.stiffness_own),
        borrow(x.lift),
    )


@njit(cache=True, inline="always")
def lent_fields(x: Fields) -> Fields:  # pragma: no cover - compiled
    """The same Fields, its arrays borrowed."""
    return Fields(borrow(x.u), borrow(x.q), borrow(x.d), borrow(x.constant), borrow(x.coefficients), borrow(x.buffer))


@njit(cache=True, inline="always")
def lent_state(x: LoopState) -> LoopState:  # pragma: no cover - compiled
    """The same LoopState, its arrays borrowed."""
    return LoopState(
        borrow(x.predicted),
        borrow(x.value),
        borrow(x.rate),
        borrow(x.force),
        borrow(x.normal),
        borrow(x.tangential),
        borrow(x.status),
        borrow(x.segment),
        borrow(x.xi),
        borrow(x.works),
        borrow(x.statistics),
        borrow(x.counters),
        borrow(x.active),
        borrow(x.motion),
    )


@njit(cache=True, inline="always")
def lent_scratch(x: Scratch) -> Scratch:  # pragma: no cover - compiled
    """The same Scratch, its arrays borrowed."""
    return Scratch(
        borrow(x.displacement),
        borrow(x.moved),
        borrow(x.shape),
        borrow(x.slide),
        borrow(x.weights),
        borrow(x.slopes),
        borrow(x.nodes),
        borrow(x.delta),
        borrow(x.earlier),
        borrow(x.buffer),
    )


@njit(cache=True, inline="always")
def lent_record(x: Record) -> Record:  # pragma: no cover - compiled
    """The same Record, its arrays borrowed."""
    return Record(
        x.every,
        borrow(x.contacts),
        borrow(x.watch),
        borrow(x.energies),
        borrow(x.kept),
        borrow(x.watch_rows),
        borrow(x.watch_lift),
    )
