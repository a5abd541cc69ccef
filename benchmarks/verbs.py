"""Every verb of the program on the templates and on imported matrices: what one waits for, and what one then reads.

python benchmarks/verbs.py [--short] [--only MODEL,…] [--verbs VERB,…] [--before SRC] [--limit S] [--folder DIR]
(--short: one verb on the two beams, for CI; --before: the src folder of another checkout, which runs beside this one)

Each verb is a process of its own at a terminal of 80 columns, with one BLAS thread, in a folder that holds nothing of
other verbs; compiled functions are in their cache. CPU: user and system. Silence: the longest time without a word.
Needs a POSIX system.
"""

from __future__ import annotations

import argparse
import os
import pty
import re
import select
import signal
import subprocess
import sys
import tempfile
import time
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

SRC = Path(__file__).resolve().parents[1] / "src"
PROGRAM = "import sys; from stridor.app.entry import main; sys.exit(main())"
PAD = ["bodies.disc.mesh.divisions=[8,72,2]"]
COARSEST = [
    "bodies.disc.mesh.divisions=[4,44,1]",
    "bodies.lining.mesh.divisions=[4,9,2]",
    "bodies.plate.mesh.divisions=[4,9,1]",
]
TEMPLATES = {
    "coarsest pad": ("pad-on-disc", COARSEST),
    "two beams": ("two-beams", []),
    "coarse pad": ("pad-on-disc", PAD),
}
DAMPINGS = {
    "pad-on-disc": ("bodies.disc.damping.stiffness=1e-8:8e-8", "bodies.lining.damping.stiffness=1e-8:8e-8"),
    "two-beams": ("bodies.beam1.damping.stiffness=1e-9:2e-8", "bodies.beam2.damping.stiffness=1e-9:2e-8"),
    "imported": ("bodies.matrices.terms.1.factor=0.5:2", "bodies.matrices.terms.3.factor=0.5:1"),
}
AT_MU = ("export", "modes", "shapes", "report", "sensitivities", "countermeasures")  # take μ where no contact says it


@dataclass(frozen=True)
class Tree:
    """A checkout. source: its src; limit: what a verb may take [s]."""

    name: str
    source: Path
    limit: float


@dataclass(frozen=True)
class Run:
    """What one call took: CPU [s], [MB], first output and longest silence [s], lines; status None: over the limit."""

    cpu: float
    memory: float
    first: float
    silence: float
    lines: int
    status: int | None


def run(words: list[str], folder: Path, tree: Tree, log: Path) -> Run | None:
    """``stridor words…`` in a folder, at a terminal; all it says is kept in a file. None: there is no such verb."""
    ours, theirs = pty.openpty()
    environment = os.environ | {"PYTHONPATH": str(tree.source), "COLUMNS": "80", "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    began = time.monotonic()
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words], cwd=folder, env=environment, stdin=subprocess.DEVNULL, stdout=theirs,
        stderr=theirs, start_new_session=True,
    )  # fmt: skip
    os.close(theirs)
    said, heard, stopped = b"", [began], False
    while True:
        left = began + tree.limit - time.monotonic()
        if not stopped and not select.select([ours], [], [], max(left, 0.0))[0]:
            os.killpg(process.pid, signal.SIGKILL)
            stopped = True
        try:
            piece = os.read(ours, 65536)
        except OSError:  # Linux says so that nobody writes any more, others by nothing to read
            piece = b""
        heard.append(time.monotonic())
        said += piece
        if not piece:
            break
    os.close(ours)
    _, code, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(code)
    log.write_bytes(said)
    return None if b"No such command" in said else Run(
        cpu=used.ru_utime + used.ru_stime,
        memory=used.ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3),
        first=heard[1] - began,
        silence=max(later - sooner for sooner, later in pairwise(heard)),
        lines=lines_of(said),
        status=None if stopped else process.returncode,
    )  # fmt: skip


def lines_of(said: bytes) -> int:
    """Lines that stay on the terminal: not those that tell of progress and are erased."""
    kept = [re.sub(rb".*(\r|\x1b\[2K)", b"", line.rstrip(b"\r")) for line in said.split(b"\n")]
    return len(kept) - (not kept[-1])


def verbs() -> list[str]:
    """What --help lists, in its order."""
    environment = os.environ | {"PYTHONPATH": str(SRC), "COLUMNS": "80"}
    said = subprocess.run([sys.executable, "-m", "stridor", "--help"], env=environment, capture_output=True, text=True)
    return re.findall(r"^  ([a-z][a-z-]+) ", said.stdout.split("Commands:")[1], flags=re.MULTILINE)


def words_of(verb: str, model: str) -> list[str]:
    """The verb's words, with what it cannot do without."""
    template, changes = TEMPLATES.get(model, ("imported", []))
    if verb == "new":
        return ["new", template, *(word for change in changes for word in ("--set", change))]
    words = [verb, "case.toml", "--out", f"out-{verb}"]
    if template == "imported" and verb in AT_MU:
        words += ["--mu", "0.5"]
    if verb == "damping-map":
        (x, x_range), (y, y_range) = (place.split("=") for place in DAMPINGS[template])
        words += ["--x", x, "--x-range", x_range, "--y", y, "--y-range", y_range, "--points", "3"]
    if verb == "reduce":
        words += ["--onsets", "mu"]
    return words


def prepare(model: str, folder: Path) -> None:
    """case.toml of a model, made by the program of this checkout."""
    folder.mkdir(parents=True, exist_ok=True)
    if model == "imported":
        prepare("coarsest pad", folder / "pad")
        plain = ["--set", "modal.friction_damping=false"]  # so that friction is a matrix times mu
        words, written = ["export", "pad/case.toml", *plain, "--out", "."], "matrices.toml"
    else:
        words, written = words_of("new", model), f"{TEMPLATES[model][0]}.toml"
    log = folder / "prepared.txt"
    made = run([*words, "--force"], folder, Tree("now", SRC, 300.0), log)
    if made is None or made.status:
        raise SystemExit(log.read_text())
    (folder / written).rename(folder / "case.toml")


def warm(folder: Path, tree: Tree) -> None:
    """Compile both time loops once: what each takes the first time on a machine is not what it takes."""
    for model in ("two beams", "coarsest pad"):
        place = folder / "warm" / tree.name / model
        prepare(model, place)
        words = ["simulate", "case.toml", "--set", "phases.0.duration=1e-5"]
        run(words, place, replace(tree, limit=600.0), place / "warm.txt")


def row(taken: Run | None, limit: float) -> list[str]:
    """CPU, memory, first output, silence, lines, exit status."""
    if taken is None:
        return ["no such verb", "–", "–", "–", "–", "–"]
    status = f"> {limit:g} s" if taken.status is None else str(taken.status)
    seconds = [f"{value:.1f}" for value in (taken.cpu, taken.first, taken.silence)]
    return [seconds[0], f"{taken.memory:.0f}", *seconds[1:], str(taken.lines), status]


def measure(models: list[str], wanted: list[str], trees: list[Tree], folder: Path) -> bool:
    """Prints the table row by row. Whether all ended well."""
    print("| model | verb | tree | CPU s | MB | first output s | silence s | lines | exit status |", flush=True)
    print("|---|---|---|---:|---:|---:|---:|---:|---|", flush=True)
    well = True
    for model in models:
        for tree in trees:
            prepare(model, folder / tree.name / model)
        for verb, tree in product(wanted, trees):
            if verb == ("new" if model == "imported" else "matrices"):
                continue  # of templates, of imported matrices
            place = folder / tree.name / model
            (place / "new").mkdir(exist_ok=True)
            taken = run(words_of(verb, model), place / "new" if verb == "new" else place, tree, place / f"{verb}.txt")
            print("|", " | ".join([model, verb, tree.name, *row(taken, tree.limit)]), "|", flush=True)
            well &= taken is not None and taken.status == 0
    return well


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--short", action="store_true")
    parser.add_argument("--only", default="coarsest pad,two beams,imported,coarse pad", metavar="MODEL,…")
    parser.add_argument("--verbs", metavar="VERB,…", help="[default: all that have a model]")
    parser.add_argument("--before", type=Path, metavar="SRC")
    parser.add_argument("--limit", type=float, default=300.0, help="seconds that a verb may take [default: 300]")
    parser.add_argument("--limit-before", type=float, default=300.0, help="the same of --before")
    parser.add_argument("--folder", type=Path, help="where all is run and kept [default: one that passes]")
    args = parser.parse_args()
    trees = [Tree("now", SRC, args.limit)]
    if args.before:
        trees.append(Tree("before", args.before.resolve(), args.limit_before))
    with tempfile.TemporaryDirectory() as passing:
        folder = (args.folder or Path(passing)).resolve()
        if args.short:
            if not measure(["two beams"], ["check"], trees, folder):
                raise SystemExit("check of the two beams did not end well")
            return
        for tree in trees:
            warm(folder, tree)
        measure(args.only.split(","), args.verbs.split(",") if args.verbs else verbs(), trees, folder)


if __name__ == "__main__":
    main()
