"""Runs benchmarks one after the other in short mode, in one process: python benchmarks/_short.py SCRIPT…

Starting Python with all that these import takes as long as most of them do in short mode. What each says is printed
when it has ended, with the processor time that it took; the exit status tells whether one failed.
"""

from __future__ import annotations

import io
import os
import runpy
import sys
import traceback
from contextlib import redirect_stderr, redirect_stdout


def run(script: str) -> bool:
    """Whether it ends well."""
    said, well, before = io.StringIO(), False, sum(os.times()[:4])
    sys.argv = [script, "--short"]
    try:
        with redirect_stdout(said), redirect_stderr(said):
            runpy.run_path(script, run_name="__main__")
        well = True
    except SystemExit as left:
        well = left.code in (None, 0)
        said.write("" if well else f"{left.code}\n")
    except Exception:
        said.write(traceback.format_exc())
    print(f"== {script} --short: {sum(os.times()[:4]) - before:.1f} s of the processor\n{said.getvalue()}", flush=True)
    return well


if __name__ == "__main__":
    sys.exit(not all([run(script) for script in sys.argv[1:]]))
