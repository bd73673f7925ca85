"""Results: numbers with their errors, and the rest by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Estimate:
    """A number with its error."""

    value: float
    """The number, in the unit of the analysis."""
    error: float | None
    """Its estimated error, in the same unit."""
    rays: int | None = None
    """The rays that it is computed from."""
    seconds: float | None = None
    """The time that it took, together with the numbers that were computed with it."""

    def __float__(self) -> float:
        return float(self.value)

    def __format__(self, spec: str) -> str:
        return format(self.value, spec) if spec else str(self)

    def __str__(self) -> str:
        return f"{self.value:.6g}" if self.error is None else f"{self.value:.6g} ± {self.error:.1g}"


class Result(Mapping[str, Any]):
    """The result of a command: its entries by name, as attributes or by `[]`."""

    def __init__(self, entries: Mapping[str, Any], seconds: float | None = None) -> None:
        self._entries = {name: from_json(value, seconds) for name, value in entries.items()}

    def __getattr__(self, name: str) -> Any:
        entries = self.__dict__.get("_entries", {})
        if name not in entries:
            raise AttributeError(f"no entry `{name}`; there are {', '.join(entries)}")
        return entries[name]

    def __getitem__(self, name: str) -> Any:
        return self._entries[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._entries]

    def __repr__(self) -> str:
        return f"Result({self._entries!r})"

    def __reduce__(self) -> tuple[Any, ...]:
        return (_result_of, (self._entries,))


def _result_of(entries: dict[str, Any]) -> Result:
    """A result of entries that are no JSON any more, for `pickle`."""
    result = Result({})
    result._entries = entries
    return result


def from_json(value: Any, seconds: float | None = None) -> Any:
    """A value of JSON with estimates and results in place of objects. Numbers without a time of their own
    have that of what they are a part of."""
    if isinstance(value, list):
        return [from_json(entry, seconds) for entry in value]
    if not isinstance(value, dict):
        return value
    milliseconds = value.get("milliseconds")
    if isinstance(milliseconds, (int, float)):
        seconds = 1e-3 * milliseconds
    if value.keys() <= {"value", "error", "rays", "milliseconds"} and {"value", "error"} <= value.keys():
        return Estimate(value["value"], value["error"], value.get("rays"), seconds)
    return Result(value, seconds)
