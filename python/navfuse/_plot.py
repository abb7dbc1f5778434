"""Figures of a run with matplotlib."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from navfuse._run import Innovations, Run, State

#: Radius of the Earth for the axes of a track, m.
_EARTH = 6_371_000.0
#: Ellipses along a track.
_ELLIPSES = 24

#: A panel: its height, and the function that draws it.
Panel = tuple[int, Callable[[Any], None]]


def figure(run: Run, names: Sequence[str]) -> Any:
    """The figure of a track, of states and of sensors; all of them without names."""
    import matplotlib.pyplot as plt

    panels = [panel for name in names or _all(run) for panel in _panels(run, name)]
    heights = [height for height, _ in panels]
    fig, axes = plt.subplots(
        len(panels),
        squeeze=False,
        figsize=(8.0, 2.0 * sum(heights)),
        layout="constrained",
        gridspec_kw={"height_ratios": heights},
    )
    for (_, draw), ax in zip(panels, axes[:, 0]):
        draw(ax)
    fig.suptitle(f"{run.summary['scenario']}: {run.verdict.level.replace('_', ' ')}")
    return fig


def _all(run: Run) -> list[str]:
    uncertain = [name for name, state in run.items() if state.sigma.size and state.sigma.any()]
    return [*(["track"] if _position(run) else []), *uncertain, *run.innovations]


def _panels(run: Run, name: str) -> list[Panel]:
    if name == "track":
        return [(2, lambda ax: _track(run, ax))]
    if name in run.innovations:
        innovations = run.innovations[name]
        return [(1, _channel(innovations, k)) for k in range(len(innovations.channels))]
    if name not in run:
        names = ", ".join(["track", *run, *run.innovations])
        raise KeyError(f"no state or sensor {name!r}; the names are {names}")
    return [(1, _component(run[name], k)) for k in range(len(run[name].components))]


def _component(state: State, k: int) -> Callable[[Any], None]:
    """One component: its error within two sigma, or its estimate with a band of two sigma."""

    def draw(ax: Any) -> None:
        known = state.error is not None and not np.isnan(state.error[:, k]).all()
        geodetic = state.components != state.differences
        band = 2.0 * state.sigma[:, k]
        if state.error is not None and known:
            line, label = state.error[:, k], f"{state.differences[k]}: error and ±2σ"
            ax.fill_between(state.time, -band, band, alpha=0.25, linewidth=0)
        elif geodetic:
            line, label = band / 2.0, f"{state.differences[k]}: 1σ"
        else:
            line, label = state.estimate[:, k], f"{state.components[k]} ±2σ"
            ax.fill_between(state.time, line - band, line + band, alpha=0.25, linewidth=0)
        ax.plot(state.time, line, linewidth=1.0)
        _label(ax, f"{state.name}, {label}", state.unit)

    return draw


def _channel(innovations: Innovations, k: int) -> Callable[[Any], None]:
    """The innovations of a channel in sigma; those that were not accepted are marked."""

    def draw(ax: Any) -> None:
        normalised = innovations.value[:, k] / innovations.sigma[:, k]
        used = innovations.accepted
        ax.axhspan(-2.0, 2.0, alpha=0.15, linewidth=0)
        ax.plot(innovations.time[used], normalised[used], ".", markersize=2)
        ax.plot(innovations.time[~used], normalised[~used], "x", markersize=4, color="tab:red")
        _label(ax, f"{innovations.sensor}, {innovations.channels[k]}: innovation", "σ")

    return draw


def _track(run: Run, ax: Any) -> None:
    """The track over the ground, with ellipses of two sigma."""
    from matplotlib.patches import Ellipse

    position = run[_position(run)]
    latitude, longitude = np.radians(position.estimate[:, :2]).T
    north = _EARTH * (latitude - latitude[0])
    east = _EARTH * np.cos(latitude[0]) * (longitude - longitude[0])
    ax.plot(east, north, linewidth=1.0)
    for k in np.unique(np.linspace(0, len(north) - 1, _ELLIPSES).astype(int)):
        size = 4.0 * position.sigma[k, [1, 0]]
        ax.add_patch(Ellipse((east[k], north[k]), *size, fill=False, linewidth=0.5))
    ax.set_aspect("equal", adjustable="datalim")
    _label(ax, "track, ±2σ", "north, m")
    ax.set_xlabel("east, m")


def _position(run: Run) -> str:
    """The name of the first position; empty without one."""
    return next((name for name, s in run.items() if s.units[:2] == ("deg", "deg") and s.unit == "m"), "")


def _label(ax: Any, title: str, unit: str) -> None:
    ax.set_title(title, loc="left", fontsize="small")
    ax.set_ylabel(unit)
    ax.set_xlabel("time, s")
    ax.grid(alpha=0.3)
