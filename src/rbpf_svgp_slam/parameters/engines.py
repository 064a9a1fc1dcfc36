"""The map engines by name. Only names stand here: this is read before any engine is imported."""

from __future__ import annotations

#: Name under `map/engine`, which is also the engine's parameter group: module and class.
ENGINES = {"svgp": ("rbpf_svgp_slam.svgp.svgp_map", "SvgpMap")}
