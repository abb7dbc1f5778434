"""What a notebook or a browser shows: the page of a run, and the progress of long work."""

from __future__ import annotations

import html
import subprocess
import sys
import tempfile
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from navfuse._errors import NavfuseError


def page(log: str, out: Path) -> None:
    """Writes the page that ``navfuse report`` makes of a log."""
    command = [sys.executable, "-m", "navfuse", "report", log, "--out", str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise NavfuseError(done.stderr.strip().removeprefix("error: "))


def show(log: str) -> None:
    """Shows the page of a log in the cell of a notebook, or in the browser."""
    out = Path(tempfile.mkdtemp(prefix="navfuse-")) / "report.html"
    page(log, out)
    if notebook() is None:
        webbrowser.open(out.as_uri())
        return
    text = html.escape(out.read_text(encoding="utf-8"))
    _display(f'<iframe srcdoc="{text}" style="width:100%;height:50em;border:0"></iframe>')


def notebook() -> Any:
    """The shell of the notebook in which this runs; None outside of one."""
    if "IPython" not in sys.modules:
        return None
    from IPython import get_ipython

    shell = get_ipython()  # type: ignore[no-untyped-call, unused-ignore]
    return shell if hasattr(shell, "kernel") else None


@contextmanager
def bar() -> Iterator[Callable[[float, float | None], None]]:
    """A function that shows progress: as a bar in a notebook, or on standard error."""
    if notebook() is None:
        yield _terminal
        print(file=sys.stderr)
    else:
        handle = _display("", display_id=True)
        yield lambda done, end: handle.update(_html(_bar(done, end)))


def _bar(done: float, end: float | None) -> str:
    """A bar in HTML; one without an end moves."""
    if not end:
        return f"<progress></progress> {done:.0f}"
    return f'<progress value="{min(max(done / end, 0.0), 1.0):.3f}"></progress> {done:.0f} of {end:.0f}'


def _terminal(done: float, end: float | None) -> None:
    part = min(max(done / end, 0.0), 1.0) if end else 0.0
    text = f"{done:.0f} of {end:.0f}" if end else f"{done:.0f}"
    print(f"\r[{'#' * round(32 * part):32}] {text}", end="", file=sys.stderr, flush=True)


def _html(text: str) -> Any:
    from IPython.display import HTML

    return HTML(text)  # type: ignore[no-untyped-call, unused-ignore]


def _display(text: str, **options: Any) -> Any:
    from IPython.display import display

    return display(_html(text), **options)  # type: ignore[no-untyped-call, unused-ignore]
