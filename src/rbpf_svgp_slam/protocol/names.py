"""Names of nodes, services and parameters that several processes use."""

from __future__ import annotations

#: Parameter namespace of core, map nodes and recorder alike.
PARAMETERS = "rbpf_svgp_slam"
CORE = "rbpf_core"
FILTER_STATUS = f"{CORE}/status"
PATH = f"{CORE}/path"
DEAD_RECKONING_PATH = f"{CORE}/dead_reckoning_path"
#: All pings so far, thinned, placed by the estimate.
BATHYMETRY = f"{CORE}/bathymetry"
GET_MINIBATCHES = f"{CORE}/get_minibatches"
GET_BEAMS = f"{CORE}/get_beams"
GET_PINGS = f"{CORE}/get_pings"
GET_CLOSURES = f"{CORE}/get_closures"
GET_FIXES = f"{CORE}/get_fixes"
TAKE_TURN = f"{CORE}/take_turn"
FINISH = f"{CORE}/finish"
#: Topics of the best particle's map, published by its node.
MAP_MEAN = "map/mean"
MAP_VARIANCE = "map/variance"
MAP_DEPTH_RANK = "map/depth_rank"
#: The map's `support_points`. The topic has its name from the engine that was the first.
MAP_SUPPORT_POINTS = "map/inducing_points"
#: The seabed of the final trajectory, published by the recorder.
MAP_SEABED = "map/seabed"
#: The ground truth as far as it has come in, published by the recorder.
TRUTH_PATH = "ground_truth_path"
#: How the survey goes, for RViz.
STATUS_IMAGE = "status_image"
#: File of a run folder in which the core keeps what has changed the survey.
JOURNAL = "survey.journal"
#: Plays a bag for replay.launch. Its parameters: rosbag play's exit status, PLAYING before it has
#: ended, and what went wrong.
PLAYER = "player"
PLAYER_STATUS = f"{PLAYER}/status"
PLAYER_PROBLEM = f"{PLAYER}/problem"
PLAYING = -1
#: Parameter that an offline replay sets before its map nodes start.
TAKE_TURNS = f"{CORE}/take_turns"
#: Parameters by which an offline replay says that it is through, how long it took, and what went
#: wrong.
REPLAY_FINISHED = f"{CORE}/replay_finished"
REPLAY_WALL_S = f"{CORE}/replay_wall_s"
REPLAY_PROBLEM = f"{CORE}/replay_problem"


def map_node(index: int) -> str:
    """Name of a map node, 0 .. B - 1."""
    return f"svgp_node_{index}"


def map_status(index: int) -> str:
    """Topic of a map node's MapStatus."""
    return f"{map_node(index)}/status"


def get_maps(index: int) -> str:
    """Service of a map node that hands out whole maps."""
    return f"{map_node(index)}/get_maps"


def fetch_maps(index: int) -> str:
    """Service of a map node that hands maps over to other map nodes."""
    return f"{map_node(index)}/fetch_maps"
