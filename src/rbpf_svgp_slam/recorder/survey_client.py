"""Fetches a finished survey from the core, and a particle's map from its node."""

from __future__ import annotations

import time
from dataclasses import dataclass

import numpy as np
import rospy

from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.shares import owner
from rbpf_svgp_slam.run.closures import Closures
from rbpf_svgp_slam.run.fixes import Fixes
from rbpf_svgp_slam.srv import Finish, GetClosures, GetFixes, GetMaps, GetPings

PINGS_A_CALL = 1000
# With a core that is started again, and reads its journal first.
CORE_PATIENCE_S, RETRY_S = 60.0, 0.5


@dataclass
class Survey:
    """All pings of the survey, P, with their beams, N.

    Poses: x y z roll pitch yaw, frame map, m and rad.
    """

    stamp_s: np.ndarray  # [P]
    estimate: np.ndarray  # [P, 6]
    estimate_covariance: np.ndarray  # [P, 6] xx, xy, x yaw, yy, y yaw, yaw yaw
    online: np.ndarray  # [P, 6] the estimate when the ping was taken in
    online_covariance: np.ndarray  # [P, 6]
    dead_reckoning: np.ndarray  # [P, 6]
    held_out: np.ndarray  # [P] bool
    ping_of_beam: np.ndarray  # [N]
    levelled: np.ndarray  # [N, 3] x, y in the levelled body frame, z in map, m


def finish_survey(survey: int) -> None:
    """Tell the core that the survey is over. One that has died is waited for: it is started again.

    survey: its number. Raises rospy.ROSException or rospy.ServiceException if the core does not
    come back, RuntimeError if it refuses.
    """
    give_up_s = time.monotonic() + CORE_PATIENCE_S
    while True:
        try:
            rospy.wait_for_service(names.FINISH, timeout=CORE_PATIENCE_S)
            answer = rospy.ServiceProxy(names.FINISH, Finish)(survey)
            break
        except rospy.ServiceException:
            if time.monotonic() > give_up_s or rospy.is_shutdown():
                raise
            time.sleep(RETRY_S)
    if not answer.success:
        raise RuntimeError(f"{names.FINISH} refused: {answer.message}")


def fetch_survey() -> Survey:
    """Raises RuntimeError if the core refuses."""
    get_pings = rospy.ServiceProxy(names.GET_PINGS, GetPings, persistent=True)
    pieces, first = [], 0
    while True:
        piece = get_pings(first=first, count=PINGS_A_CALL)
        if not piece.success:
            raise RuntimeError(f"{names.GET_PINGS} refused: {piece.message}")
        pieces.append(piece)
        first += len(piece.beams_per_ping)
        if first >= piece.pings_total or not piece.beams_per_ping:
            break

    def joined(name: str, dtype: str, columns: int) -> np.ndarray:
        return np.frombuffer(b"".join(getattr(p, name) for p in pieces), dtype).reshape(-1, columns)

    beams_per_ping = np.concatenate([np.asarray(p.beams_per_ping, dtype=int) for p in pieces])
    return Survey(
        stamp_s=joined("stamps", "<f8", 1)[:, 0],
        estimate=joined("estimate", "<f8", 6),
        estimate_covariance=joined("estimate_covariance", "<f8", 6),
        online=joined("online", "<f8", 6),
        online_covariance=joined("online_covariance", "<f8", 6),
        dead_reckoning=joined("dead_reckoning", "<f8", 6),
        held_out=np.concatenate([np.asarray(p.held_out, dtype=bool) for p in pieces]),
        ping_of_beam=np.repeat(np.arange(len(beams_per_ping)), beams_per_ping),
        levelled=joined("beams", "<f4", 3).astype(float),
    )


def fetch_closures() -> Closures:
    """The loop closures; none from a core that has no such service.

    Raises RuntimeError if the core refuses.
    """
    try:
        answer = rospy.ServiceProxy(names.GET_CLOSURES, GetClosures)()
    except rospy.ServiceException as error:
        rospy.logwarn("No loop closures in the report: %s", error)
        return Closures.of([])
    if not answer.success:
        raise RuntimeError(f"{names.GET_CLOSURES} refused: {answer.message}")
    return Closures.of(answer.closures)


def fetch_fixes() -> Fixes:
    """The fixes that the filter has taken. Raises RuntimeError if the core refuses."""
    answer = rospy.ServiceProxy(names.GET_FIXES, GetFixes)()
    if not answer.success:
        raise RuntimeError(f"{names.GET_FIXES} refused: {answer.message}")
    return Fixes.of(answer.fixes)


def fetch_map(particle: int, epoch: int, particles: int, nodes: int) -> bytes:
    """One particle's map as its engine writes it. Raises RuntimeError if its node refuses."""
    service = names.get_maps(owner(particle, particles, nodes))
    answer = rospy.ServiceProxy(service, GetMaps)(epoch=epoch, particles=[particle])
    if not answer.success:
        raise RuntimeError(f"{service} refused: {answer.message}")
    return answer.maps
