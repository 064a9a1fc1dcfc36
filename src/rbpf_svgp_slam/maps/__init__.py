"""Maps of the seabed behind two contracts; `map/engine` chooses what is behind them.

Nothing here imports numpy or an engine before it is needed: the parameters, among them the number
of threads, are checked against the registry first.
"""

from rbpf_svgp_slam.maps.map_group import MapGroup
from rbpf_svgp_slam.maps.minibatch_map import MinibatchMap
from rbpf_svgp_slam.maps.registry import ENGINES, group_class, load_map, make_group
from rbpf_svgp_slam.maps.seabed_map import SeabedMap
from rbpf_svgp_slam.maps.stream_map import StreamMap

__all__ = [
    "ENGINES",
    "MapGroup",
    "MinibatchMap",
    "SeabedMap",
    "StreamMap",
    "group_class",
    "load_map",
    "make_group",
]
