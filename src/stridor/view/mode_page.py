"""The page on which a mode moves, without the mode. Loads nothing that computes or draws, so that a server that shows
it starts without."""

from __future__ import annotations

from typing import Any

from jinja2 import Environment, StrictUndefined
from markupsafe import Markup

from .page_files import template_text

# Matplotlib's "viridis" at 64 places, as figures have it: to load all of that for these takes a server half a second.
RAMP = (
    "44015446075a470d6047136548186a481d6f482374482878472d7b46327e453781443b844240864045883e49893d4e8a"
    "3a538b38588c365c8d34608d32648e31688e2f6c8e2d708e2c738e2a778e297b8e277f8e26828e24868e238a8d218e8d"
    "20928c1f968b1f9a8a1f9e891fa18721a58523a98326ad812ab07f2fb47c35b7793bbb7542be714ac16d52c5695ac864"
    "65cb5e6ece5877d15381d34d8bd64695d840a0da39aadc32b5de2bc0df25cae11fd5e21adfe318eae51af4e61efde725"
)
COLOURS = tuple(f"#{RAMP[k : k + 6]}" for k in range(0, len(RAMP), 6))  # of the displacement, from none to the largest


def animation_shell() -> str:
    """The page of `animation_html` without a mode, for a frame: the page around it posts the data of `page_data` to it,
    {geometry} all of them or {motion} those of another mode, with {title, growth, unstable} and {dark}."""
    return mode_page(
        title="", growth="", kind="stable", note="slowed down", description="A mode in motion", data=None, framed=True
    )


def mode_page(*, viewer: bool = False, **content: Any) -> str:
    """The page with its words and the mode that it plays; viewer: whether it has what draws with the graphics card."""
    page = Environment(autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    ramp = ", ".join(COLOURS[:: (len(COLOURS) - 1) // 9])
    return page.from_string(template_text("mode.html.j2")).render(
        ramp=ramp, script=Markup(template_text("mode.js")), viewer=Markup(viewer_script()) if viewer else "", **content
    )


def viewer_script() -> str:
    """What draws modes with the graphics card, for a page that has `mode.js`: built from viewer/ by `make viewer`."""
    return template_text("viewer.js")
