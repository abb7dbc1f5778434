from os import PathLike
from typing import Any, Callable, Sequence, final

__all__ = ["QUICKSTART", "Scenario", "__version__", "command"]

QUICKSTART: str
__version__: str

def command(arguments: Sequence[str]) -> int: ...

@final
class Scenario:
    @staticmethod
    def load(path: str | PathLike[str]) -> Scenario: ...
    @staticmethod
    def parse(name: str, text: str) -> Scenario: ...
    @property
    def name(self) -> str: ...
    def set(self, settings: Sequence[str]) -> Scenario: ...
    def to_toml(self) -> str: ...
    def check(self) -> tuple[list[BaseException], str]: ...
    def run(
        self,
        out: str | PathLike[str] | None,
        covariance: bool,
        progress: Callable[[float, float | None], object] | None,
    ) -> dict[str, Any]: ...
