"""Modes in motion: a page that turns and plays them without anything else, and a GIF for slides.

Both show Re(û e^{jφ}) with the complex phases of the vector, so that travelling waves travel. Growth is said in words;
the motion is drawn with constant amplitude.
"""

from __future__ import annotations

import base64
import io
from typing import Any

import numpy as np
from jinja2 import Environment, StrictUndefined
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from PIL import Image

from ..errors import CaseError
from ..system import System
from ..typing import Array, ComplexArray
from .depth_picture import sharp_edges
from .page_files import template_text
from .skin import Skin, at_largest, distinct, drawn_scale, facet_edges, mode_title, skin_of
from .solid_plots import AMPLITUDES, EDGES_UP_TO, VIEW, body_colour, concentrated, draw_frame
from .style import styled

QUANTA = 32767  # steps of a displacement in the page, from none to the largest amplitude
RAMP = 64  # colours of the displacement in the page
GIF_PERIOD = 1.6  # seconds for one cycle
GIF_DPI = 80
GIF_PIXELS = 520  # of the solid, along the longer side


def animation_html(
    system: System,
    vector: Array | ComplexArray,
    *,
    frequency_hz: float,
    growth_rate: float = 0.0,
    scale: float | None = None,
    title: str | None = None,
) -> str:
    """A page that plays the vector û (n,) and needs nothing else: drag turns, the wheel zooms.

    ``scale`` multiplies displacements at amplitude 1 of the page's slider, otherwise they are scaled to be seen;
    ``title`` stands above, otherwise the frequency. Raises CaseError for a vector that does not fit the system.
    """
    skin = skin_of(system, vector)
    heading = title or f"Mode at {mode_title(frequency_hz, None)}"
    moving = "three-dimensional view, turned by dragging or the arrow keys" if skin.dimension == 3 else "plane view"
    return _page(
        title=heading,
        growth=growth_in_words(growth_rate),
        kind="unstable" if growth_rate > 0 else "stable",
        note=(f"{mode_title(frequency_hz, None)}, " if title else "") + "slowed down, drawn with constant amplitude",
        description=f"{heading}: {', '.join(skin.names)} in motion, {moving}",
        data=page_data(skin, scale=scale),
        framed=False,
    )


def animation_shell() -> str:
    """The page of `animation_html` without a mode, for a frame: the page around it posts the data of `page_data` to it,
    {geometry} all of them or {motion} those of another mode, with {title, growth, unstable} and {dark}."""
    return _page(
        title="", growth="", kind="stable", note="slowed down", description="A mode in motion", data=None, framed=True
    )


def _page(**content: Any) -> str:
    page = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    ramp = [_hex(row) for row in _ramp()[:: (RAMP - 1) // 9]]
    return page.from_string(template_text("mode.html.j2")).render(
        ramp=", ".join(ramp), script=Markup(template_text("mode.js")), **content
    )


@styled
def animation_gif(
    system: System,
    vector: Array | ComplexArray,
    *,
    frequency_hz: float,
    growth_rate: float = 0.0,
    frames: int = 24,
    scale: float | None = None,
    view: tuple[float, float] = VIEW,
) -> bytes:
    """One cycle of the vector û (n,) as an endless GIF of ``frames`` pictures, coloured by |u|.

    ``scale`` multiplies displacements, otherwise they are scaled to be seen; ``view`` is elevation and azimuth of the
    line of sight [degrees]. Raises CaseError for a vector that does not fit the system and for less than 2 frames.
    """
    if frames < 2:
        raise CaseError("frames", frames, "at least 2 pictures make a motion")
    skin = skin_of(system, vector)
    words = mode_title(frequency_hz, growth_rate)
    pictures: list[Any] = []
    for k in range(frames):
        figure = draw_frame(skin, phase=2 * np.pi * k / frames, scale=scale, view=view, title=words, pixels=GIF_PIXELS)
        figure.set_dpi(GIF_DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        picture = Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB")
        # One palette for all frames: with one of its own for each, still parts would flicker.
        first = pictures[0] if pictures else picture.quantize(colors=255)
        pictures.append(picture.quantize(palette=first, dither=Image.Dither.NONE))
    palette = _white_paper(pictures[0])
    for picture in pictures:
        picture.putpalette(palette)
    held = io.BytesIO()
    each = round(1000 * GIF_PERIOD / frames)
    pictures[0].save(held, "GIF", save_all=True, append_images=pictures[1:], duration=each, loop=0, disposal=1)
    return held.getvalue()


def _white_paper(picture: Any) -> list[int]:
    """The palette of a picture with white for the colour of its corner, which reduced colours only come near to."""
    palette, paper = picture.getpalette(), picture.getpixel((0, 0))
    return [*palette[: 3 * paper], 255, 255, 255, *palette[3 * paper + 3 :]]


def growth_in_words(growth_rate: float) -> str:
    """Whether a mode grows and how soon it is ten times as large, or a tenth."""
    if growth_rate == 0:
        return "neither grows nor decays"
    time = np.log(10.0) / abs(growth_rate)
    much = f"{1e3 * time:.3g} ms" if time < 1 else f"{time:.3g} s"
    kind, change = ("unstable", "ten times as large") if growth_rate > 0 else ("stable", "a tenth")
    return f"{kind}: growth rate {growth_rate:+.4g} 1/s, {change} after {much}"


def page_data(skin: Skin, *, scale: float | None) -> dict[str, Any]:
    """What the page's script reads: the skin about its middle, arrays as base64 in the machine's usual byte order.

    points (k, 3) float32 [m]; real and imag (k, 3) int16, QUANTA being the largest amplitude; facets (f, 4), edges
    (e, 2), segments (s, 2) as uint16, or uint32 where ``wide``. ``scale`` [m] is the largest amplitude as drawn;
    bent: whether colours go with the root of the amplitude (`solid_plots.concentrated`).
    """
    rotated, largest = at_largest(skin.motion)
    drawn = drawn_scale(skin, largest, scale) * largest
    unit = rotated / (largest or 1.0)
    low, high = skin.points.min(axis=0), skin.points.max(axis=0)
    half = (high - low) / 2 + abs(drawn)
    wide = len(skin.points) > 65535
    index = "<u4" if wide else "<u2"
    if len(skin.facets) <= EDGES_UP_TO:
        edges = distinct(facet_edges(skin.facets))[0]
    else:
        edges = sharp_edges(skin.points, skin.facets) if skin.dimension == 3 else skin.edges
    colours = np.array([to_rgb(body_colour(k)) for k in range(len(skin.names))])
    return {
        "names": list(skin.names),
        "meshed": len(skin.names) - len(np.unique(skin.segment_body)),
        "dimension": skin.dimension,
        "closed": skin.closed,
        "wide": wide,
        "elevation": VIEW[0],
        "azimuth": VIEW[1],
        "scale": drawn,
        "bent": concentrated(skin),
        "half": [float(h) for h in _padded(half[None])[0]],
        "colours": _bytes(colours),
        "pale": _bytes(0.65 * colours + 0.35),
        "ramp": _bytes(_ramp()),
        "points": _packed(_padded(skin.points - (low + high) / 2), "<f4"),
        "real": _packed(np.round(QUANTA * _padded(unit.real)), "<i2"),
        "imag": _packed(np.round(QUANTA * _padded(unit.imag)), "<i2"),
        "facets": _packed(skin.facets, index),
        "edges": _packed(edges, index),
        "body": _packed(skin.body % 256, "u1"),
        "segments": _packed(skin.segments, index),
        "segment_body": _packed(skin.segment_body % 256, "u1"),
    }


def _packed(values: Any, kind: str) -> str:
    return base64.b64encode(np.ascontiguousarray(values).astype(kind).tobytes()).decode("ascii")


def _padded(values: Array) -> Array:
    """Vectors (k, d) in space (k, 3)."""
    return np.pad(values, ((0, 0), (0, 3 - values.shape[1])))


def _ramp() -> Array:
    return colormaps[AMPLITUDES](np.linspace(0.0, 1.0, RAMP))[:, :3]


def _bytes(colours: Array) -> list[list[int]]:
    return [[round(255 * float(v)) for v in row] for row in colours]


def _hex(colour: Array) -> str:
    return "#" + "".join(f"{round(255 * float(v)):02x}" for v in colour)
