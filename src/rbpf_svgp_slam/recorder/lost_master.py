"""Whether the ROS master that a survey was started with has gone for good.

A master keeps nothing: one that is started anew knows none of the nodes, and none of them tells it
again. What is connected goes on without it, but nobody can be found, asked or ended any more.
"""

from __future__ import annotations

import xmlrpc.client

import rosgraph


def lost_master(node: str) -> str:
    """Why the master of a registered node is lost; empty: it is not, as far as can be told.

    One that cannot be reached may come back: only what nobody listens for any more is lost.
    """
    uri = rosgraph.get_master_uri()
    try:
        rosgraph.Master(node).lookupNode(node)
    except ConnectionRefusedError:
        return f"the master at {uri} has died"
    except rosgraph.MasterError:
        return f"the master at {uri} was started anew and knows none of the survey's nodes"
    except (OSError, rosgraph.MasterException, xmlrpc.client.Error):
        pass
    return ""
