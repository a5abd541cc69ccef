"""Modes in motion: a page that turns and plays them without anything else, and a GIF for slides.

Both show Re(û e^{jφ}) with the complex phases of the vector, so that travelling waves travel. Growth is said in words;
the motion is drawn with constant amplitude.
"""

from __future__ import annotations

import io
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from ..errors import CaseError
from ..system import System
from ..typing import Array, ComplexArray
from .mode_motion import growth_in_words, page_data
from .mode_page import mode_page
from .skin import VIEW, mode_title, skin_of
from .solid_plots import draw_frame
from .style import styled

VIEWER_FROM = 10_000  # triangles; of fewer the viewer weighs more than the page, and the canvas is quick: docs/app.md
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
    return mode_page(
        title=heading,
        growth=growth_in_words(growth_rate),
        kind="unstable" if growth_rate > 0 else "stable",
        note=(f"{mode_title(frequency_hz, None)}, " if title else "") + "slowed down, drawn with constant amplitude",
        description=f"{heading}: {', '.join(skin.names)} in motion, {moving}",
        data=page_data(skin, scale=scale),
        framed=False,
        viewer=skin.triangles >= VIEWER_FROM,
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
