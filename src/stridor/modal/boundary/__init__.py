"""Curves in a plane of two numbers on which a mode begins to grow, traced without a grid.

`plane` is the problem over the two numbers, `spot` one point of a curve solved by Newton's method, `march` the way
along a curve, `curve` what comes of it, `crossings` where straight lines cross curves, `search` the lines on which
curves are found and what is counted between them.
"""

from .curve import Drawn, StabilityCurve, carried, crossings, drawn
from .plane import Plane
from .search import Found, boundaries

__all__ = ["Drawn", "Found", "Plane", "StabilityCurve", "boundaries", "carried", "crossings", "drawn"]
