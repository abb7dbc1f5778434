"""Campaigns in parts, which processes and machines share."""

from __future__ import annotations

import io
import json
import os
import tempfile
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from navfuse import _navfuse

if TYPE_CHECKING:
    from navfuse._scenario import Scenario


@dataclass(frozen=True)
class Campaign:
    """A campaign of many runs: :meth:`Scenario.campaign`.

    The records of a run are the same on any machine, so that the merged parts are the campaign of one
    machine, to the bit.

    >>> import navfuse
    >>> scenario = navfuse.Scenario.from_toml(navfuse.QUICKSTART).set("estimator.stop", "70 s")
    >>> parts = [shard.run() for shard in scenario.campaign(2).shards(2)]
    >>> merge(parts) == scenario.monte_carlo(2)
    True
    """

    scenario: Scenario
    request: dict[str, Any]

    def shards(self, count: int) -> list[Shard]:
        """The campaign in ``count`` parts, each with about as many runs."""
        if count < 1:
            raise ValueError(f"{count} parts: one is the least")
        return [Shard(self, index, count) for index in range(1, count + 1)]


@dataclass(frozen=True)
class Shard:
    """A part of a campaign. It can be pickled, and so be sent to another process or machine."""

    campaign: Campaign
    index: int
    count: int

    def run(self, jobs: int = 1) -> bytes:
        """Runs the part on ``jobs`` threads, and returns its files, for :func:`merge`."""
        with tempfile.TemporaryDirectory() as folder:
            request = self.campaign.request | {"jobs": jobs, "out": folder}
            request["shard"] = (self.index, self.count)
            _navfuse.campaign(self.campaign.scenario._inner, request, None)
            return _packed(Path(folder))


def merge(parts: Iterable[bytes], out: str | os.PathLike[str] | None = None) -> dict[str, Any]:
    """Merges all parts of a campaign, as ``navfuse merge`` does.

    Args:
        parts: what :meth:`Shard.run` returned, in any order.
        out: folder for the tables.

    Returns:
        The report of :meth:`Scenario.monte_carlo`.
    """
    with tempfile.TemporaryDirectory() as folder:
        folders = [_unpacked(part, Path(folder) / str(k)) for k, part in enumerate(parts)]
        whole = os.path.join(folder, "whole") if out is None else os.fspath(out)
        return cast("dict[str, Any]", json.loads(_navfuse.merge(folders, whole)))


def _packed(folder: Path) -> bytes:
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(p for p in folder.iterdir() if p.is_file()):
            archive.write(path, path.name)
    return data.getvalue()


def _unpacked(part: bytes, folder: Path) -> str:
    with zipfile.ZipFile(io.BytesIO(part)) as archive:
        archive.extractall(folder)
    return str(folder)
