"""Stands in for a map node that does nothing but ask for minibatches, as fast as it can."""

from __future__ import annotations

import json
import signal
import sys

import rospy

from rbpf_svgp_slam.protocol.names import GET_MINIBATCHES
from rbpf_svgp_slam.srv import GetMinibatches

MINIBATCH_SIZE = 1000


def main() -> None:
    """Ask for the particles first .. last - 1 until terminated; then print what has come."""
    # not SIGINT, which is ignored in what a script starts in the background
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    first, last = map(int, sys.argv[1:])
    rospy.init_node(f"asker_{first}", disable_signals=True)
    rospy.wait_for_service(GET_MINIBATCHES)
    ask = rospy.ServiceProxy(GET_MINIBATCHES, GetMinibatches, persistent=True)
    replies = 0
    try:
        while True:
            replies += ask(list(range(first, last)), MINIBATCH_SIZE).success
    except KeyboardInterrupt:
        print(json.dumps({"minibatches": replies * (last - first)}))


if __name__ == "__main__":
    main()
