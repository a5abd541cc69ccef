"""Few point contacts on beams: the scheme in a complete basis of real modes, or on the freedoms in a band."""

from .stepper import ModalStepper, choose_path, modal_stepper, refuses

__all__ = ["ModalStepper", "choose_path", "modal_stepper", "refuses"]
