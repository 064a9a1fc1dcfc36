"""Starts a map node: parameters first, for the number of threads must be known to what follows."""

from __future__ import annotations

from rbpf_svgp_slam import cpu
from rbpf_svgp_slam.parameters.loading import NodeParameters, validate_index
from rbpf_svgp_slam.parameters.rules import ParameterError
from rbpf_svgp_slam.parameters.server import load_parameters
from rbpf_svgp_slam.protocol import names


def start() -> int | str:
    """Run the node until shutdown; returns what sys.exit() takes."""
    try:
        parameters = load_parameters("svgp_node")
        # Here already, because rospy loads a numerical library.
        cpu.prepare(parameters.map.threads)
        return _run(parameters)
    except ParameterError as error:
        return f"svgp_node: {error}"
    except KeyboardInterrupt:
        return 0


def _run(parameters: NodeParameters) -> int:
    import rospy

    from rbpf_svgp_slam.map_node.node import MapNode
    from rbpf_svgp_slam.maps import make_group

    try:
        maps = make_group(parameters)
    except (ValueError, NotImplementedError) as error:  # the engine's own parameters
        raise ParameterError(f"{names.PARAMETERS}/{error}") from None
    except RuntimeError as error:  # torch makes one of an interrupt while it is imported
        if "KeyboardInterrupt" in str(error):
            raise KeyboardInterrupt from None
        raise
    rospy.init_node("svgp_node")
    index = validate_index(rospy.get_param("~index", None), parameters.nodes)
    own_name = rospy.get_name().split("/")[-1]
    if own_name != names.map_node(index):
        # The other nodes find this one by its name.
        raise ParameterError(
            f"the node's name is {own_name}; expected {names.map_node(index)}, by ~index"
        )
    MapNode(index, parameters, maps).spin()
    return 0
