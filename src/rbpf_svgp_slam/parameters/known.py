"""The parameters that there are, as config/default.yaml has them; and what a wrong name meant."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, Iterator, Sequence

import rospkg
import yaml

from rbpf_svgp_slam.nested import all_names, unknown_names

PACKAGE = "rbpf_svgp_slam"
# How much of a name must be right, by difflib's ratio: of the whole, or of what follows its group.
ALIKE, ALIKE_IN_GROUP = 0.9, 0.6


def config_folder() -> Path:
    """Where default.yaml and the overlays that come with the package are."""
    return Path(rospkg.RosPack().get_path(PACKAGE)) / "config"


def default_parameters() -> dict[str, Any]:
    """The tree of all parameters with their defaults."""
    return yaml.safe_load((config_folder() / "default.yaml").read_text(encoding="utf-8"))


def complaints(tree: dict[str, Any], known: dict[str, Any]) -> Iterator[str]:
    """For each name in the tree that `known` does not have: that, and what may have been meant."""
    names = list(all_names(known))
    for name in unknown_names(tree, known):
        meant = nearest_name(name, names)
        if meant:
            yield f"{name} is unknown; did you mean {meant}?"
        else:
            yield f"{name} is unknown; expected one of {', '.join(_siblings(name, names))}"


def nearest_name(mistyped: str, names: Sequence[str]) -> str:
    """The name that was most likely meant; empty if there is none like it.

    That is one with a letter or two wrong anywhere, or else one like it in its group (`rate` for
    `rate_hz`), or else the same name in another group.
    """
    whole = difflib.get_close_matches(mistyped, names, 1, ALIKE)
    if whole:
        return whole[0]
    group, leaf = _split(mistyped)
    beside = difflib.get_close_matches(leaf, _siblings(mistyped, names), 1, ALIKE_IN_GROUP)
    if beside:
        return f"{group}{beside[0]}"
    elsewhere = [name for name in names if _split(name)[1] == leaf]
    return "".join(difflib.get_close_matches(mistyped, elsewhere, 1, 0.0))


def _siblings(name: str, names: Sequence[str]) -> list[str]:
    """Names in the same group, without it."""
    group = _split(name)[0]
    return [leaf for its_group, leaf in map(_split, names) if its_group == group]


def _split(name: str) -> tuple[str, str]:
    """The group, with its slash, and the name in it."""
    group, slash, leaf = name.rpartition("/")
    return group + slash, leaf
