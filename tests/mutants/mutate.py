"""The tests of the tests: small faults are put into a copy of the sources, one at a time, and a test must fail.

    make mutants        or        python tests/mutants/mutate.py [--sample 35] [--seed 1] [--minutes 60] [--report]

The faults (mutants) are those of cosmic-ray; the sample, which tests meet which module, and what was found out about
survivors are ours: covering.toml and equivalent.toml beside this file. Every answer is kept at once in one line of
build/mutants/results.jsonl, by the text of its fault: stopped and started again it goes on, and a line whose module has
changed since no longer counts. The working tree itself is never touched.
"""

from __future__ import annotations

import argparse
import ast
import difflib
import fnmatch
import hashlib
import importlib
import json
import os
import random
import resource
import shutil
import signal
import sys
import time
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILD = ROOT / "build" / "mutants"
TOOLS, TREE, RESULTS = BUILD / "tools", BUILD / "tree", BUILD / "results.jsonl"
ENOUGH = 30  # tried in a package before its share says anything: then 95 % allows one survivor
PACKAGES = ("temporal", "contact", "laws", "sliding", "fe")

ARITHMETIC, ORDER = ("Add", "Sub", "Mul", "Div"), ("Eq", "NotEq", "Lt", "LtE", "Gt", "GtE")
# Loaded once and inherited by every child: most of what a start of pytest costs.
HEAVY = (
    "pytest", "hypothesis", "numpy", "scipy.linalg", "scipy.sparse.linalg", "scipy.optimize", "scipy.signal",
    "scipy.interpolate", "scipy.spatial", "numba", "pydantic", "typer", "typer.testing", "rich", "tomlkit", "jinja2",
    "xarray", "h5netcdf", "matplotlib.pyplot", "skfem", "meshio", "threadpoolctl",
)  # fmt: skip

# Machine code of the sources as they are serves every mutant of a module that no kernel calls; the others run as
# plain Python. Only in the copy.
SAME_KERNELS = '''

_as_they_are = read_sources


def read_sources():
    found = _as_they_are()
    return None if found is None else Sources(found.location, (), "{digest}")
'''
# What a mutant compiles must not serve the next.
READ_ONLY = '''
import os

if os.environ.get("STRIDOR_MUTANT"):
    KernelCache.save_overload = lambda self, sig, data: None
'''
# What is written in instructions of the machine has none as plain Python: stand-ins, in the copy, for the kernels around
# it. Faults in it are tried with everything compiled afresh.
STAND_INS = {
    "temporal/steppers/borrow.py": '''

if __import__("os").environ.get("NUMBA_DISABLE_JIT"):

    def borrow(array):
        return array
''',
    "kernels/denormals.py": '''

if __import__("os").environ.get("NUMBA_DISABLE_JIT"):
    exchange = _nothing
''',
    "temporal/steppers/modal/vectors.py": '''

if __import__("os").environ.get("NUMBA_DISABLE_JIT"):
    import ctypes as _ctypes

    import numpy as _np

    def _seen(at, count):
        return _np.ctypeslib.as_array((_ctypes.c_double * count).from_address(int(at)))

    def address(array):
        return array.ctypes.data

    def load(rows, at):
        return _seen(rows + 8 * LANES * at, LANES).copy()

    def store(rows, at, value):
        _seen(rows + 8 * LANES * at, LANES)[:] = value

    def number(flat, at):
        return float(_seen(flat + 8 * at, 1)[0])

    def zero():
        return _np.zeros(LANES)

    def plus(x, y):
        return x + y

    def plus_product(z, x, y):
        return z + x * y

    def minus_product(z, x, y):
        return z - x * y

    def total(x):
        return float(x.sum())

    times = product = lambda x, y: x * y
    plus_times = plus_product
''',
    "temporal/steppers/sparse/lanes.py": '''


def _in_python(d):
    def rows(ptr, col, val, x, y, lo, hi):
        for i in range(lo, hi):
            at = slice(i * LANES[d], i * LANES[d] + d)
            total = val[ptr[i]].reshape(d, d) @ x[at]
            for p in range(ptr[i] + 1, ptr[i + 1]):
                to = slice(col[p] * LANES[d], col[p] * LANES[d] + d)
                total = total + val[p].reshape(d, d) @ x[to]
                y[to] += val[p].reshape(d, d).T @ x[at]
            y[at] += total

    return rows


if __import__("os").environ.get("NUMBA_DISABLE_JIT"):
    rows2, rows3 = _in_python(2), _in_python(3)
''',
}


@dataclass(frozen=True)
class Mutant:
    """One fault: where (module below src/stridor, line), which operator, its n-th place, and the text it leaves."""

    module: str
    operator: str
    occurrence: int
    line: int
    before: str
    after: str

    @property
    def name(self) -> str:
        """The fault by its text and place among equals: the same after lines elsewhere have moved."""
        return f"{self.module}: {self.before.strip()} -> {self.after.strip()} [{self.operator} {self.occurrence}]"


@dataclass(frozen=True)
class Cover:
    """The modules of one entry of covering.toml, the tests that meet them (likeliest first), and how they run."""

    modules: tuple[str, ...]
    tests: tuple[str, ...]
    compiled: bool
    weight: float
    afresh: bool = False


def operators() -> dict[str, Any]:
    """Those of cosmic-ray that leave sensible code: no shifts of numbers, no `is` between them, no decorators."""
    sys.path.append(str(TOOLS))  # behind ours, whose versions of shared packages win
    try:
        provider = importlib.import_module("cosmic_ray.operators.provider").OperatorProvider()
    except ImportError:
        sys.exit("mutate: cosmic-ray is missing; `make mutants` puts it into build/mutants/tools")
    chosen: dict[str, Any] = {}
    for name in provider:
        kind, _, change = name.partition("_")
        to = change.rpartition("_")[2]
        if kind == "ReplaceBinaryOperator" and not (to in ARITHMETIC or change in ("BitAnd_BitOr", "BitOr_BitAnd")):
            continue
        if kind == "ReplaceComparisonOperator" and not (to in ORDER or change in ("Is_IsNot", "IsNot_Is")):
            continue
        if name in ("RemoveDecorator", "VariableReplacer", "VariableInserter", "ExceptionReplacer"):
            continue
        chosen[name] = provider[name]()
    return chosen


def covers() -> list[Cover]:
    """What covering.toml holds; the first entry that names a module is its own."""
    with open(HERE / "covering.toml", "rb") as file:
        return [
            Cover(
                tuple(e["modules"]), tuple(e["tests"]), bool(e.get("compiled", False)), float(e.get("weight", 1.0)),
                bool(e.get("afresh", False)),
            )
            for e in tomllib.load(file)["cover"]
        ]


def cover_of(module: str, known: list[Cover]) -> Cover:
    """The entry of a module; a module without tests named for it is an error here, not a survivor."""
    for entry in known:
        if any(fnmatch.fnmatch(module, pattern) for pattern in entry.modules):
            return entry
    sys.exit(f"mutate: tests/mutants/covering.toml names no tests for {module}")


def modules() -> list[str]:
    """All modules of the packages that are mutated, in a fixed order."""
    top = ROOT / "src" / "stridor"
    return sorted(path.relative_to(top).as_posix() for name in PACKAGES for path in (top / name).rglob("*.py"))


def places(source: str, known: dict[str, Any]) -> dict[tuple[Any, str], list[tuple[str, int]]]:
    """(place, kind of fault) → operators and their occurrence: one place is drawn once, whatever may happen to it."""
    tree = importlib.import_module("cosmic_ray.ast").get_ast(source)
    nodes: list[Any] = []

    def walk(node: Any) -> None:
        nodes.append(node)
        for child in getattr(node, "children", ()):
            walk(child)

    walk(tree)
    found: dict[tuple[Any, str], list[tuple[str, int]]] = {}
    for name, operator in known.items():
        count = 0
        for node in nodes:
            for start, end in operator.mutation_positions(node):
                found.setdefault(((start, end), name.partition("_")[0]), []).append((name, count))
                count += 1
    return found


def meaning(source: str) -> str:
    """The code without annotations and decorators: a fault in what does nothing at run time is none."""
    tree = ast.parse(source)
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            node.returns, node.decorator_list = None, []  # how it is compiled is not what it does
            for argument in [*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs]:
                argument.annotation = None
        elif isinstance(node, ast.AnnAssign):
            node.annotation = ast.Constant(None)
    return ast.dump(tree)


def mutated(source: str, operator: Any, occurrence: int) -> str | None:
    """The source with the fault, None where it changes nothing or is no Python."""
    text = importlib.import_module("cosmic_ray.mutating").mutate_code(source, operator, occurrence)
    try:
        return None if text is None or meaning(text) == meaning(source) else text
    except SyntaxError:
        return None


def draw(count: int, seed: int, only: str, known: list[Cover]) -> tuple[list[Mutant], Counter[str]]:
    """Places of each package, by weight, in random order (the beginning of a sample is one too); how many there are."""
    acting = operators()
    drawn: list[Mutant] = []
    total: Counter[str] = Counter()
    for package in PACKAGES:
        own = [name for name in modules() if name.startswith(package + "/") and name.startswith(only)]
        sources = {name: (ROOT / "src" / "stridor" / name).read_text(encoding="utf-8") for name in own}
        sites: list[tuple[float, str, Any, list[tuple[str, int]]]] = []
        for name, source in sources.items():
            weight = cover_of(name, known).weight
            for (span, kind), choice in sorted(places(source, acting).items()):
                chance = random.Random(f"{seed} {name} {span} {kind}").random()
                sites.append((chance ** (1.0 / weight), name, span, choice))
        total[package] = len(sites)
        left = count
        for _, name, span, choice in sorted(sites, key=lambda site: site[0], reverse=True):
            operator, occurrence = random.Random(f"{seed} {name} {span}").choice(choice)
            after = mutated(sources[name], acting[operator], occurrence) if left else None
            if after is not None:
                drawn.append(Mutant(name, operator, occurrence, span[0][0], *changed(sources[name], after)))
                left -= 1
    return drawn, total


def changed(before: str, after: str) -> tuple[str, str]:
    """The lines that differ, as they were and as they are."""
    lines = list(difflib.ndiff(before.splitlines(), after.splitlines()))
    return tuple(" ".join(x[2:].strip() for x in lines if x[0] == sign) for sign in "-+")  # type: ignore[return-value]


# -- one mutant --------------------------------------------------------------------------------------------------------


def sources_digest() -> str:
    """Of all sources of the working tree."""
    digest = hashlib.sha256()
    for path in sorted((ROOT / "src").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def copy_tree() -> None:
    """A fresh copy of sources and tests, whose kernels are those of the sources as they are."""
    shutil.rmtree(TREE, ignore_errors=True)
    TREE.mkdir(parents=True)
    left_out = shutil.ignore_patterns("__pycache__", "*.out")
    for name in ("src", "tests", "docs", "benchmarks"):
        shutil.copytree(ROOT / name, TREE / name, ignore=left_out)
    for name in ("pyproject.toml", "README.md", "CHANGELOG.md", "Makefile", "environment.yml", "hatch_build.py"):
        shutil.copy(ROOT / name, TREE / name)
    with open(TREE / "src/stridor/kernels/sources.py", "a", encoding="utf-8") as file:
        file.write(SAME_KERNELS.format(digest=sources_digest()))
    with open(TREE / "src/stridor/kernels/store.py", "a", encoding="utf-8") as file:
        file.write(READ_ONLY)
    for name, text in STAND_INS.items():
        with open(TREE / "src/stridor" / name, "a", encoding="utf-8") as file:
            file.write(text)


def child(cover: Cover, log: Path, tests: tuple[str, ...], limit: float) -> None:
    """Run the tests over the copy, in a process of its own. Never returns. limit: CPU seconds, 0 for none."""
    os.setsid()
    handle = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o644)
    os.dup2(handle, 1)
    os.dup2(handle, 2)
    os.chdir(TREE)
    os.environ["PYTHONPATH"] = str(TREE / "src")
    os.environ["STRIDOR_CACHE_DIR"] = str(BUILD / ("afresh" if cover.afresh else "kernels"))
    shutil.rmtree(BUILD / "afresh", ignore_errors=True)
    sys.path.insert(0, str(TREE / "src"))
    if limit:
        os.environ["STRIDOR_MUTANT"] = "1"
        resource.setrlimit(resource.RLIMIT_CPU, (int(limit) + 1, int(limit) + 6))
    if not (cover.compiled or cover.afresh):
        os.environ["NUMBA_DISABLE_JIT"] = "1"
        importlib.import_module("numba.core.config").DISABLE_JIT = True
    code = 99
    try:
        pytest = importlib.import_module("pytest")
        code = int(pytest.main(["-x", "-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--no-header", "--tb=line",
                                "--durations=10", *(tests or cover.tests)]))  # fmt: skip
    finally:
        os._exit(code)


def run_tests(cover: Cover, limit: float, log: Path, tests: tuple[str, ...] = ()) -> tuple[str, float]:
    """("survived" | "killed" | "time", CPU seconds): pytest's own 0 is survival, any other end is not.

    The limit is of processor time, so that a busy machine kills nothing; one that sleeps is ended after 20 times that.
    """
    started = time.monotonic()
    process = os.fork()
    if process == 0:
        child(cover, log, tests, limit)
    while True:
        done, status, used = os.wait4(process, os.WNOHANG)
        if done:
            end = os.waitstatus_to_exitcode(status)
            word = "survived" if end == 0 else "time" if end in (-signal.SIGXCPU, -signal.SIGKILL) else "killed"
            return word, used.ru_utime + used.ru_stime
        if limit and time.monotonic() - started > 20 * limit:
            os.killpg(process, signal.SIGKILL)
            os.waitpid(process, 0)
            return "time", limit
        time.sleep(0.02)


def plain_seconds(cover: Cover, tests: tuple[str, ...]) -> float:
    """CPU seconds of the tests without a fault, measured once for each state of the sources. Exits where one fails."""
    path = BUILD / "plain.json"
    known: dict[str, float] = json.loads(path.read_text()) if path.exists() else {}
    how = "afresh" if cover.afresh else str(cover.compiled)
    key = " ".join([sources_digest()[:16], how, *(tests or cover.tests)])
    if key not in known:
        end, spent = run_tests(cover, 0.0, BUILD / "plain.log", tests)
        print(f"{end:9s}{spent:6.1f} s  without a fault: {' '.join(cover.modules)}", flush=True)
        if end != "survived":
            sys.exit(f"mutate: tests fail without any fault:\n{(BUILD / 'plain.log').read_text(errors='replace')[-3000:]}")
        known[key] = spent
        path.write_text(json.dumps(known, indent=1))
    return known[key]


def try_mutant(mutant: Mutant, cover: Cover, limit: float, acting: dict[str, Any],
               tests: tuple[str, ...] = ()) -> tuple[str, float]:  # fmt: skip
    """Write the fault into the copy, run the tests, take it out again."""
    path = TREE / "src" / "stridor" / mutant.module
    source, stamp = path.read_text(encoding="utf-8"), path.stat().st_mtime_ns
    text = mutated(source, acting[mutant.operator], mutant.occurrence)
    assert text is not None
    try:
        path.write_text(text, encoding="utf-8")
        os.utime(path, ns=(stamp + 10**10, stamp + 10**10))  # the byte code of the source as it is must not serve
        return run_tests(cover, limit, BUILD / "last.log", tests)
    finally:
        path.write_text(source, encoding="utf-8")
        os.utime(path, ns=(stamp, stamp))


# -- all of them -------------------------------------------------------------------------------------------------------


def kept() -> dict[str, dict[str, Any]]:
    """Answers so far by the mutant's name; of several the last counts."""
    if not RESULTS.exists():
        return {}
    lines = (json.loads(line) for line in RESULTS.read_text(encoding="utf-8").splitlines() if line.endswith("}"))
    return {line["name"]: line for line in lines}


def keep(line: dict[str, Any]) -> None:
    with open(RESULTS, "a", encoding="utf-8") as file:
        file.write(json.dumps(line, ensure_ascii=False) + "\n")
        file.flush()
        os.fsync(file.fileno())


def report(drawn: list[Mutant], total: Counter[str]) -> int:
    """Print what came of the sample; 1 where less than 95 % of what is not equivalent were killed, or too few tried."""
    with open(HERE / "equivalent.toml", "rb") as file:
        equivalent = {entry["name"]: entry["reason"] for entry in tomllib.load(file).get("equivalent", [])}
    answers = kept()
    tried = [mutant for mutant in drawn if mutant.name in answers]
    ends = Counter("equivalent" if m.name in equivalent else answers[m.name]["end"] for m in tried)
    for mutant in tried:
        if answers[mutant.name]["end"] == "survived" and mutant.name not in equivalent:
            print(f"survived  {mutant.module}:{mutant.line}\n  {mutant.name}")
    judged = len(tried) - ends["equivalent"]
    share = (ends["killed"] + ends["time"]) / max(judged, 1)
    few: list[str] = []
    for package in (name for name in PACKAGES if total[name]):
        own = Counter("equivalent" if m.name in equivalent else answers[m.name]["end"] for m in tried
                      if m.module.startswith(package + "/"))  # fmt: skip
        print(f"{package:9s}{total[package]:5d} places {own.total():4d} tried {own['killed']:4d} killed {own['time']:3d} out of time "
              f"{own['survived']:3d} survived {own['equivalent']:3d} equivalent")  # fmt: skip
        if own.total() < ENOUGH:
            few.append(f"{package} ({own.total()})")
    print(f"{len(tried)} of the {len(drawn)} drawn from {total.total()} places: {ends['killed']} killed, {ends['time']} ran out "
          f"of time, {ends['survived']} survived, {ends['equivalent']} equivalent: {100 * share:.1f} % killed of "
          f"{judged} that are not equivalent")  # fmt: skip
    if few:
        print(f"too few to judge, below {ENOUGH} tried: {', '.join(few)}")
    return int(share < 0.95 or bool(few))


def main() -> int:
    text = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    text.add_argument("--sample", type=int, default=35, help="how many places to draw in each package")
    text.add_argument("--seed", type=int, default=1)
    text.add_argument("--minutes", type=float, default=60.0, help="start no other mutant after this time")
    text.add_argument("--only", default="", help="modules that begin so, as in contact/ or laws/friction.py")
    text.add_argument("--again", action="store_true", help="try those that survived once more")
    text.add_argument("--tests", nargs="*", default=[], help="these tests instead of those of covering.toml")
    text.add_argument("--report", action="store_true", help="try nothing, tell what is known")
    chosen = text.parse_args()
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    BUILD.mkdir(parents=True, exist_ok=True)
    known = covers()
    drawn, total = draw(chosen.sample, chosen.seed, chosen.only, known)
    if chosen.report:
        return report(drawn, total)
    copy_tree()
    for name in HEAVY:
        importlib.import_module(name)
    acting, answers, started = operators(), kept(), time.monotonic()
    for mutant in drawn:
        if time.monotonic() - started > 60 * chosen.minutes:
            print("time is up; started again it goes on from here")
            break
        before = answers.get(mutant.name)
        if before is not None and not (chosen.again and before["end"] == "survived"):
            continue
        cover, tests = cover_of(mutant.module, known), tuple(chosen.tests)
        limit = 20.0 + 4.0 * plain_seconds(cover, tests)
        end, spent = try_mutant(mutant, cover, limit, acting, tests)
        keep({"name": mutant.name, "end": end, "seconds": round(spent, 1), "line": mutant.line})
        print(f"{end:9s}{spent:6.1f} s  {mutant.module}:{mutant.line}  {mutant.before} -> {mutant.after}", flush=True)
    return report(drawn, total)


if __name__ == "__main__":
    sys.exit(main())
