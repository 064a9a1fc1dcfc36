"""Parameters and other settings: groups of names and values, nested."""

from __future__ import annotations

from typing import Any, Iterator


def flatten(tree: dict[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values of nested groups as (slash/separated/name, value)."""
    for key, value in tree.items():
        if isinstance(value, dict):
            yield from flatten(value, f"{prefix}{key}/")
        else:
            yield f"{prefix}{key}", value


def merged(base: dict[str, Any], overlay: dict[str, Any]) -> dict[str, Any]:
    """`base` with all that `overlay` says, group by group."""
    result = dict(base)
    for name, value in overlay.items():
        is_group = isinstance(value, dict) and isinstance(result.get(name), dict)
        result[name] = merged(result[name], value) if is_group else value
    return result


def unknown_names(overlay: dict[str, Any], known: dict[str, Any], group: str = "") -> Iterator[str]:
    """Names, with their groups, that `known` does not have."""
    for name, value in overlay.items():
        if name not in known:
            yield f"{group}{name}"
        elif isinstance(value, dict) and isinstance(known[name], dict):
            yield from unknown_names(value, known[name], f"{group}{name}/")


def all_names(tree: dict[str, Any], group: str = "") -> Iterator[str]:
    """Names of all values and groups, with the groups that they are in."""
    for name, value in tree.items():
        yield f"{group}{name}"
        if isinstance(value, dict):
            yield from all_names(value, f"{group}{name}/")
