"""What pages are made of: figures with their words, files of pictures, templates filled in."""

from __future__ import annotations

import base64
import io
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, Literal

from jinja2 import Environment, FunctionLoader, StrictUndefined
from matplotlib.figure import Figure

from .page_files import template_text
from .style import styled

PNG_DPI = 180
_UNIT = re.compile(r"(\d) (Hz|kHz|N/m|N|m/s²|m/s|1/s|mm|s|GPa|%)(?!\w)")
_KINDS = {"svg": "svg+xml", "png": "png"}

Kind = Literal["svg", "png"]


@dataclass(frozen=True)
class ReportFigure:
    """A figure: name (its file and anchor), title, caption, alternative text, the drawing or what draws it when it is
    wanted."""

    name: str
    title: str
    caption: str
    alt: str
    drawing: Figure | Callable[[], Figure]

    @cached_property
    def figure(self) -> Figure:
        """The drawing, made at most once."""
        return self.drawing if isinstance(self.drawing, Figure) else self.drawing()


def filled(template: str, **content: Any) -> str:
    """The page of a template beside this package with that content."""
    return _environment().get_template(template).render(**content)


@styled
def rendered(figure: Figure, kind: Kind) -> bytes:
    """The figure as a file of that kind, equal for equal figures."""
    target = io.BytesIO()
    if kind == "svg":
        figure.savefig(target, format="svg", metadata={"Date": None})
    else:
        figure.savefig(target, format=kind, dpi=PNG_DPI, metadata={"Software": "stridor"})
    return target.getvalue()


def data_url(picture: bytes, kind: Kind) -> str:
    """A picture as an address that holds it."""
    return f"data:image/{_KINDS[kind]};base64,{base64.b64encode(picture).decode('ascii')}"


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=FunctionLoader(template_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["tidy"] = tidy
    return environment


def tidy(text: str) -> str:
    """The text with numbers and units that stay on one line."""
    joined = text.replace("μ = ", "μ\u00a0=\u00a0").replace(" ≤ ", "\u00a0≤\u00a0").replace(" · ", "\u202f·\u202f")
    return _UNIT.sub("\\1\u00a0\\2", joined)
