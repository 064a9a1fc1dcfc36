"""The map engines by name. Only names stand here: this is read before any engine is imported."""

from __future__ import annotations

#: Name under `map/engine`, which is also that of the engine's parameter group, to module and class
#: of its `MapGroup` (maps/map_group.py).
ENGINES = {
    "svgp": ("rbpf_svgp_slam.svgp.group", "SvgpGroup"),
    "gmrf": ("rbpf_svgp_slam.gmrf.gmrf_group", "GmrfGroup"),
}
