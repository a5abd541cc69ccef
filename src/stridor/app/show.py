"""Results of the verbs as readable tables."""

from __future__ import annotations

from typing import Any

from ..digits import measured, readable
from .output import stdout
from .tables import table


def show_run(summary: dict[str, Any]) -> None:
    """Contacts by phase, dominant frequency, energies, cost."""
    rows = [
        [
            phase["name"],
            name,
            measured(c["max_normal_force"], 2),
            measured(c["max_slip_speed"], 4),
            f"{100 * c['stick_fraction']:.1f}",
            f"{100 * c['slip_fraction']:.1f}",
            f"{100 * c['separation_fraction']:.1f}" + (", kept closed" if c.get("kept_closed") else ""),
        ]
        for phase in summary["phases"]
        for name, c in phase["contacts"].items()
    ]
    columns = ["phase", "contact", "max N [N]", "max slip [m/s]", "stick [%]", "slip [%]", "open [%]"]
    if rows:  # a case may have no contacts
        table("contacts", columns, rows, drop=["max slip [m/s]", "stick [%]"], kept_in="simulate.nc")
    _show_settled(summary)
    for change in summary["changed"]:
        stdout.print(f"changed in the middle of the run: {change}")
    stdout.print(summary["energy"]["words"])
    stdout.print(
        f"{summary['steps']} steps of {summary['dt']:.4g} s in {summary['wall_seconds']:.1f} s, {summary['path']} path"
    )
    if summary["path"] in ("exact", "implicit"):
        own = summary["path_reason"].removesuffix("; ".join(("", *summary["remarks"])))
        for said in own.split("; ")[1:]:
            stdout.print(said)
    for said in summary["remarks"]:
        stdout.print(said)


_QUANTITIES = {
    "mean_peak_normal_force": ("mean of peaks of N [N]", 1.0),
    "quantile_05_normal_force": ("5 % quantile of N [N]", 1.0),
    "quantile_50_normal_force": ("median of N [N]", 1.0),
    "quantile_95_normal_force": ("95 % quantile of N [N]", 1.0),
    "stick_fraction": ("stick [%]", 100.0),
    "slip_fraction": ("slip [%]", 100.0),
    "separation_fraction": ("open [%]", 100.0),
}


def _show_settled(summary: dict[str, Any]) -> None:
    """Where contacts separate: averages that another run shares, with their spread over copies if there are any."""
    parts, copies = summary["settled"], summary.get("copies")
    if not parts:
        return
    spread = {} if copies is None else copies["contacts"]
    rows: list[list[str]] = []
    for name, part in parts.items():
        for key, (words, factor) in _QUANTITIES.items():
            row = [name, words, _figure(part["averages"][key], factor)]
            if copies is not None:
                both = (spread.get(name, {}).get(kind, {}).get(key) for kind in ("mean", "standard_deviation"))
                row += [_figure(value, factor) for value in both]
            rows.append(row)
    columns, said = ["contact", "average", "this run"], list[str]()
    if copies is not None:
        columns += [f"mean of {copies['runs']}", "± one run"]
        for name, found in spread.items():
            low, high = found["largest_normal_force"]
            ends = f"{measured(low, 2)} to {measured(high, 2)} N"
            said.append(f"contact {name}: largest recorded N from {ends} over {copies['runs']} runs")
    table("after the first separation in the last phase", columns, rows, words=["average"], kept_in="simulate.nc")
    for line in said:
        stdout.print(line)
    stdout.print(
        "contacts separate, and such motion is as a rule chaotic: largest values are of this one trajectory and "
        "differ on another machine; averages belong to the motion it settles to"
        + ("" if copies is not None else " (--copies 4 tells how far they scatter)")
    )


def _figure(value: float | None, factor: float) -> str:
    return "–" if value is None else measured(factor * value, 2)


def show_steady(document: dict[str, Any]) -> None:
    """Resultants of every contact, and how well they are solved for."""

    def numbers(values: list[float]) -> str:
        return ", ".join(f"{v:.6g}" for v in values)

    rows = [
        [
            name,
            numbers(c["force"]),
            numbers(c["moment"]),
            "–" if c["area"] != c["area"] else f"{c['area']:.4g}",
            "–" if c["largest_pressure"] != c["largest_pressure"] else f"{c['largest_pressure']:.4g}",
        ]
        for name, c in document["contacts"].items()
    ]
    columns = ["contact", "force on the slave [N]", "moment [N m]", "area [m²]", "largest pressure [Pa]"]
    table("steady sliding", columns, rows, drop=["area [m²]", "moment [N m]"], kept_in="the JSON document")
    stdout.print(
        f"{document['touching_nodes']} of {document['nodes']} slave nodes touch, {document['status']['stick']} stick "
        f"and {document['status']['slip']} slip; every freedom is in equilibrium to "
        f"{document['residual']:.1e} of the largest force"
    )


def show_agreement(document: dict[str, Any]) -> None:
    """Both approaches side by side, critical friction, verdict."""

    def shown(value: float | None, decimals: int) -> str:
        return "–" if value is None else measured(value, decimals)

    rows = [
        [
            f"{c['mu']:g}",
            shown(c["modal"]["frequency_hz"], 2),
            shown(c["temporal"]["frequency_hz"], 2),
            shown(c["modal"]["growth_rate"], 2),
            shown(c["temporal"]["growth_rate"], 2),
            "–" if c["growth_rate_error"] is None else f"{100 * c['growth_rate_error']:.2f}",
            shown(c["growth_mac"], 3),
            shown(c["temporal"]["dominant_frequency_hz"], 1),
            shown(c["mac"], 3),
        ]
        for c in document["comparisons"]
    ]
    columns = [
        "μ",
        "modal [Hz]",
        "temporal [Hz]",
        "growth modal",
        "temporal",
        "error [%]",
        "MAC",
        "run answers [Hz]",
        "MAC of run",
    ]
    if rows:
        red = [k for k, c in enumerate(document["comparisons"]) if (c["modal"]["growth_rate"] or 0.0) > 0.0]
        gone = ["MAC of run", "run answers [Hz]", "MAC"]
        table("modal against temporal", columns, rows, drop=gone, marked=red, kept_in="compare.nc")
    if document.get("answers"):
        _show_answers(document["answers"])
    if document["critical_mu_modal"] is not None:
        stdout.print(
            f"critical μ: {measured(document['critical_mu_modal'], 6)} modal, "
            f"{shown(document['critical_mu_temporal'], 6)} temporal"
        )
    for note in document["notes"]:
        stdout.print(f"note: {note}")
    stdout.print(document["verdict"])


def _show_answers(answers: list[dict[str, Any]]) -> None:
    """Onset, growth, cycle and run, a row for each μ."""

    def shown(part: dict[str, Any] | None, name: str, decimals: int = 4) -> str:
        value = None if part is None else part[name]
        return "–" if value is None else readable(value, decimals)

    rows = [
        [
            f"{a['mu']:g}",
            shown(a["onset"], "mu", 5),
            shown(a["onset"], "frequency_hz", 5),
            shown(a["growth"]["modal"], "growth_rate"),
            shown(a["growth"]["temporal"], "growth_rate"),
            shown(a["cycle"], "frequency_hz", 6),
            shown(a["cycle"], "amplitude"),
            "–" if a["cycle"] is None else a["cycle"]["method"],
            "–" if a["cycle"] is None else {True: "yes", False: "no", None: "undecided"}[a["cycle"]["stable"]],
            shown(a["run"], "frequency_hz", 6),
            shown(a["run"], "amplitude"),
        ]
        for a in answers
    ]
    columns = [
        "μ", "onset μ", "onset [Hz]", "growth modal", "growth in time", "cycle [Hz]", "cycle [m/s]", "method", "stable",
        "run [Hz]", "run [m/s]",
    ]  # fmt: skip
    gone = ["method", "onset [Hz]", "growth in time", "onset μ"]
    table("onset, growth, cycle, run", columns, rows, drop=gone, kept_in="compare.csv")
