"""Matrices that other programs have written, and what is to be known about them before they are computed with."""

from .model import Labels, StoredMatrix
from .read import common_labels, read_matrix
from .report import MatrixReport, held_freedoms, report

__all__ = ["Labels", "MatrixReport", "StoredMatrix", "common_labels", "held_freedoms", "read_matrix", "report"]
