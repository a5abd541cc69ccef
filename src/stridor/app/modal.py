"""Verbs of the modal approach: steady sliding, modes and their shapes, onsets."""

from __future__ import annotations

from typing import Annotated

import typer

from .arguments import Call, Undamped, numbers, pair, verb


@verb()
def steady(
    call: Call,
    mu: Annotated[
        float | None,
        typer.Option("--mu", min=0.0, help="Friction coefficient of every contact [default: the case's]."),
    ] = None,
) -> None:
    """Steady sliding: which nodes touch, resultants of each contact, pressure as pictures and ParaView files."""
    from ..study.analyses import steady_sliding
    from .pictures import steady_document, write_steady

    loaded = call.case()
    call.check_friction(mu)
    found = steady_sliding(loaded, mu)
    call.warn(found.warnings)
    files = write_steady(loaded, found, call.folder)
    for path in files:
        call.say(f"written: {path}")
    document = steady_document(found) | {"files": [str(f) for f in files]}
    if call.json:
        call.document(document)
        return
    from .show import show_steady

    show_steady(document)


@verb()
def shapes(
    call: Call,
    mu: Annotated[
        float | None,
        typer.Option("--mu", min=0.0, help="Friction coefficient of every contact [default: the case's]."),
    ] = None,
    branch: Annotated[
        list[int] | None,
        typer.Option("--branch", metavar="NUMBER", help="Mode by its number. Repeatable [default: the unstable ones]."),
    ] = None,
    gif: Annotated[bool, typer.Option("--gif", help="Also an animated GIF of each.")] = False,
) -> None:
    """Shapes of modes: picture, animated page, ParaView file, and where friction feeds them."""
    from ..study.unit_warnings import resolution_warnings
    from .output import table
    from .pictures import write_shapes

    loaded = call.case()
    call.check_friction(mu)
    call.warn(resolution_warnings(loaded))
    documents = write_shapes(loaded, call.folder, mu=mu, branches=branch or None, gif=gif)
    for document in documents:
        for path in document["files"]:
            call.say(f"written: {path}")
    if call.json:
        call.document({"modes": documents})
        return
    rows = [[str(d["branch"]), f"{d['frequency_hz']:.2f}", f"{d['growth_rate']:.3f}"] for d in documents]
    table("shapes", ["branch", "frequency [Hz]", "growth [1/s]"], rows)


@verb()
def modes(
    call: Call,
    mu: Annotated[
        str | None,
        typer.Option("--mu", metavar="μ|a,b|start:stop:count", help="Friction coefficients [default: the case's]."),
    ] = None,
    count: Annotated[
        int | None, typer.Option("--count", min=1, help="How many branches [default: modal.modes].")
    ] = None,
    undamped: Undamped = False,
) -> None:
    """Complex modes at one or many friction coefficients, branches followed from μ = 0."""
    from ..study import analyses
    from ..study.unit_warnings import resolution_warnings
    from .output import stdout, table

    loaded = call.case()
    values = None if mu is None else numbers(mu, "--mu")
    call.check_friction(values)
    call.warn(resolution_warnings(loaded))
    result = analyses.modes(loaded, values, count=count, damped=False if undamped else None)
    call.keep(result, "modes.nc")
    if call.json:
        call.document(result.to_json())
        return
    for row, m in enumerate(result.to_json()["modes"]):
        rows = [
            [
                str(x["branch"]),
                f"{x['frequency_hz']:.2f}",
                f"{x['growth_rate']:.3f}",
                f"{100 * x['damping_ratio']:.4f}",
                "unstable" if x["unstable"] else "",
                f"{x['residual']:.1e}",
            ]
            for x in m
        ]
        if len(result.mu) <= 5 or row in (0, len(result.mu) - 1):
            table(
                f"μ = {result.mu[row]:g}",
                ["branch", "frequency [Hz]", "growth [1/s]", "damping [%]", "", "residual"],
                rows,
            )
    for m, sentence in zip(result.mu, result.completeness, strict=bool(result.completeness)):
        stdout.print(f"{f'μ = {m:g}: ' if len(result.mu) > 1 else ''}{sentence}", markup=False)
    if result.contact_state:
        stdout.print(f"{result.contact_state}; held so at every μ", markup=False)
    if len(result.mu) > 5:

        call.say(f"{len(result.mu)} friction coefficients; first and last shown, all in the file")


@verb()
def onsets(
    call: Call,
    friction_range: Annotated[
        str | None,
        typer.Option("--range", metavar="low:high", help="Range of μ [default: modal.friction_range]."),
    ] = None,
    max_frequency: Annotated[
        float | None,
        typer.Option(
            "--max-frequency",
            metavar="HZ",
            min=0.0,
            help="Highest frequency [default: modal.max_frequency_hz].",
        ),
    ] = None,
    undamped: Undamped = False,
) -> None:
    """Every critical friction coefficient in range: solved, not bracketed."""
    from ..study import analyses
    from ..study.unit_warnings import resolution_warnings
    from .output import stdout, table

    loaded = call.case()
    chosen = None if friction_range is None else pair(friction_range, "--range")
    call.check_friction(chosen, "--range")
    call.warn(resolution_warnings(loaded))
    result = analyses.onsets(loaded, chosen, max_frequency_hz=max_frequency, damped=False if undamped else None)
    call.keep(result, "onsets.nc")
    if call.json:
        call.document(result.to_json())
        return
    if result.contact_state:
        stdout.print(f"{result.contact_state}; held so over the range of μ", markup=False)
    if not result.onsets:
        low, high = result.friction_range
        stdout.print(f"no onset for μ in {low:g} … {high:g} up to {result.max_frequency_hz:g} Hz")
        if result.completeness:
            stdout.print(result.completeness, markup=False)
        return
    rows = [
        [
            f"{o.mu:.10f}",
            f"{o.frequency_hz:.3f}",
            o.kind,
            f"{o.branches[0]} + {o.branches[1]}" if o.kind == "flutter" else str(o.branches[0]),
            "ends" if o.stabilising else "begins",
            "" if o.square_root_coefficient is None else f"{o.square_root_coefficient:.1f}",
            "" if o.growth_slope is None else f"{o.growth_slope:.4g}",
            f"{o.residual:.1e}",
        ]
        for o in result.onsets
    ]
    columns = [
        "critical μ",
        "frequency [Hz]",
        "kind",
        "modes",
        "growth",
        "κ [1/s]",
        "slope [1/s]",
        "residual",
    ]
    table("onsets, " + ("damped" if result.damped else "undamped"), columns, rows)
    stdout.print("κ: growth opens as κ √(μ − μ_c) without damping; slope: d growth/dμ at a damped onset")
    if result.completeness:
        stdout.print(result.completeness, markup=False)


VERBS = {"steady": steady, "shapes": shapes, "modes": modes, "onsets": onsets}
