"""Exceptions, each with the place of the mistake and its remedy."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from navfuse._run import Run


class NavfuseError(Exception):
    """Base class of all errors. The text is the message of the command.

    Attributes:
        message: what is wrong, where, and the remedy.
        file: the file with the mistake, if there is one.
        line: its line, counted from 1.
        column: its column, counted from 1.
        key: the path of the key, such as ``sensor.dvl.noise``.
        remedy: the part of the message that names the remedy; empty if it has none.
        excerpt: the line of the file, with marks below the mistake.
    """

    def __init__(
        self,
        message: str,
        *,
        file: str | None = None,
        line: int | None = None,
        column: int | None = None,
        key: str | None = None,
        excerpt: str | None = None,
    ) -> None:
        super().__init__(message)
        self.message = message
        self.file = file
        self.line = line
        self.column = column
        self.key = key
        self.excerpt = excerpt

    @property
    def remedy(self) -> str:
        """The part of the message that names the remedy."""
        return self.message.partition("; ")[2]

    def __str__(self) -> str:
        return f"{self.message}\n{self.excerpt}" if self.excerpt else self.message


class ScenarioError(NavfuseError, ValueError):
    """A scenario that does not fit. ``mistakes`` has all that :meth:`Scenario.check` found."""

    mistakes: tuple[NavfuseError, ...] = ()


class DataError(NavfuseError, OSError):
    """A file, a log or a source of samples that cannot be read or written."""

    # OSError builds its own text from two arguments, and this class has one
    __str__ = NavfuseError.__str__


class RunError(NavfuseError, RuntimeError):
    """A run that ended early. ``run`` has everything until then."""

    run: Run | None = None
