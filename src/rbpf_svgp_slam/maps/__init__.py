"""Maps of the seabed behind one interface; `map/engine` chooses what is behind it."""

from rbpf_svgp_slam.maps.engine import MapEngine
from rbpf_svgp_slam.maps.factory import (
    ENGINES,
    MapFactory,
    load_map,
    make_engine_class,
    make_factory,
)

__all__ = ["ENGINES", "MapEngine", "MapFactory", "load_map", "make_engine_class", "make_factory"]
