"""The parameters that the parameter server has. Without rospy: it loads a numerical library."""

from __future__ import annotations

from typing import Any

import rosgraph

from rbpf_svgp_slam.parameters.loading import NodeParameters, validate
from rbpf_svgp_slam.parameters.rules import ParameterError
from rbpf_svgp_slam.protocol import names


def load_parameters(caller: str) -> NodeParameters:
    """From the parameter server, validated; see `parameter_tree`."""
    return validate(parameter_tree(caller))


def parameter_tree(caller: str) -> dict[str, Any]:
    """All that is set below `rbpf_svgp_slam/` in the namespace that this node is started in.

    Empty if nothing is; raises ParameterError if the master does not answer. caller: the node.
    """
    name = rosgraph.names.ns_join(rosgraph.names.get_ros_namespace(), names.PARAMETERS)
    try:
        return rosgraph.Master(f"/{caller}").getParam(name)
    except rosgraph.MasterError:
        return {}
    except OSError as error:
        uri = rosgraph.get_master_uri()
        raise ParameterError(f"no parameters: ROS master {uri} does not answer: {error}") from None
