"""A map node: trains the maps of its share of the particles and answers for them."""

from __future__ import annotations

import functools
import resource
import time
import traceback
from typing import Any, Callable

import rospy

from rbpf_svgp_slam import srv
from rbpf_svgp_slam.map_node.map_publisher import MapPublisher
from rbpf_svgp_slam.map_node.map_store import MapStore
from rbpf_svgp_slam.map_node.peers import Peers
from rbpf_svgp_slam.map_node.stream_training import StreamTraining
from rbpf_svgp_slam.map_node.training import MinibatchTraining
from rbpf_svgp_slam.maps import MapGroup, StreamMap, make_group
from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.parameters.loading import NodeParameters
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.payload import BadRequest, pack, unpack

STATUS_PERIOD_S = 0.5
# Shares of resampling/timeout_s, the core's own patience. A map node times out before the core that
# waits for it, and before that the node that it fetches maps from: so the reason is passed on.
FETCH_SHARE = 0.8
FREEZE_SHARE = 0.6
ERROR_PERIOD_S = 10.0


def answers_bad_requests(response_class: type) -> Callable:
    """Decorator of a service's handler: errors become success=false with a message."""

    def decorate(handler: Callable) -> Callable:
        @functools.wraps(handler)
        def guarded(self: "MapNode", request: Any) -> Any:
            service = handler.__name__.lstrip("_")
            try:
                return handler(self, request)
            except BadRequest as error:
                message = str(error)
                rospy.logerr("%s refused: %s", service, message)
            except Exception as error:  # a bug, or out of memory: only this request fails
                message = f"{type(error).__name__}: {error}"
                rospy.logerr("%s failed: %s", service, traceback.format_exc())
            return response_class(success=False, message=message)

        return guarded

    return decorate


class MapNode:
    """Services and topics around a MapStore, and the training loop."""

    def __init__(self, index: int, parameters: NodeParameters, group: MapGroup) -> None:
        """index: 0 .. nodes - 1; group: the maps of this node, which say how they are trained."""
        self._index = index
        self._parameters = parameters
        self._engine = parameters.map.engine
        self._restarts = int(rospy.get_param("~restarts", 0))
        self._timeout_s = parameters.resampling_timeout_s
        self._begin(group)
        self._publisher = MapPublisher(self._store, parameters)
        self._status = rospy.Publisher("~status", MapStatus, queue_size=2)
        self._next_status_s = 0.0
        self._services = [
            rospy.Service("~predict", srv.PredictBeams, self._predict),
            rospy.Service("~prepare_resampling", srv.PrepareResampling, self._prepare),
            rospy.Service("~commit_resampling", srv.CommitResampling, self._commit),
            rospy.Service("~get_maps", srv.GetMaps, self._get_maps),
            rospy.Service("~fetch_maps", srv.FetchMaps, self._fetch_maps),
        ]
        rospy.Subscriber(names.FILTER_STATUS, FilterStatus, self._on_core, queue_size=1)

    def _begin(self, group: MapGroup) -> None:
        """Maps that have seen nothing, and their training."""
        parameters = self._parameters
        self._store = MapStore(self._index, parameters.particles, parameters.nodes, group)
        self._peers = Peers(self._engine, FETCH_SHARE * self._timeout_s, self._store.known_pieces)
        streams = issubclass(group.map_class, StreamMap)
        training_class = StreamTraining if streams else MinibatchTraining
        in_turns = rospy.get_param(names.TAKE_TURNS, False)
        self._training = training_class(
            self._store, group, self._between_steps, self._make_status if in_turns else None
        )

    def _begin_anew(self) -> None:
        """For another survey: of the core that was reset, or of one that has taken its place."""
        rospy.logwarn("another survey has begun: this node's maps are made anew")
        self._training.stop()
        self._begin(make_group(self._parameters))
        self._publisher.follow(self._store)

    def _on_core(self, status: FilterStatus) -> None:
        self._store.hear_survey(status.survey)

    def spin(self) -> None:
        """Train until shutdown."""
        try:
            while not rospy.is_shutdown():
                if self._store.superseded:
                    self._begin_anew()
                self._training.advance()
                self._between_steps()
        except rospy.ROSInterruptException:
            pass
        finally:
            self._training.stop()

    # Between two steps

    def _between_steps(self) -> None:
        if time.monotonic() >= self._next_status_s:
            self._next_status_s = time.monotonic() + STATUS_PERIOD_S
            self._status.publish(self._make_status())
        try:
            self._publisher.advance()
        except Exception as error:  # training goes on without a picture
            rospy.logerr_throttle(ERROR_PERIOD_S, f"publishing the map failed: {error!r}")

    def _make_status(self) -> MapStatus:
        maps = self._store.maps().values()
        status = MapStatus(
            node=self._index,
            restarts=self._restarts,
            survey=self._store.survey,
            epoch=self._store.epoch,
            past=self._store.past,
            particles=list(self._store.own),
            iterations=[one.iterations for one in maps],
            ready=[one.ready for one in maps],
            objective=[one.objective for one in maps],
            steps=self._store.steps,
            skipped_steps=self._store.skipped_steps,
            # Linux counts in units of 1024 bytes.
            peak_rss_mb=resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e6,
        )
        status.header.stamp = rospy.Time.now()
        return status

    # Services

    @answers_bad_requests(srv.PredictBeamsResponse)
    def _predict(self, request: srv.PredictBeamsRequest) -> srv.PredictBeamsResponse:
        if request.points < 1 or not request.particles:
            raise BadRequest(
                f"request is for {request.points} points of {len(request.particles)} particles; "
                "expected at least 1 of each"
            )
        shape = (len(request.particles), request.points, 2)
        positions = unpack("positions", request.positions, shape)
        self._store.check_survey(request.survey)
        answer = self._store.predict(request.epoch, request.particles, positions)
        mean, variance, prior_variance = map(pack, answer)
        return srv.PredictBeamsResponse(
            success=True,
            mean=mean,
            variance=variance,
            prior_variance=prior_variance,
        )

    @answers_bad_requests(srv.GetMapsResponse)
    def _get_maps(self, request: srv.GetMapsRequest) -> srv.GetMapsResponse:
        epoch = None if request.epoch == request.ANY_EPOCH else request.epoch
        maps = self._store.serialise(epoch, request.particles, FREEZE_SHARE * self._timeout_s)
        return srv.GetMapsResponse(success=True, engine=self._engine, **_joined(maps))

    @answers_bad_requests(srv.FetchMapsResponse)
    def _fetch_maps(self, request: srv.FetchMapsRequest) -> srv.FetchMapsResponse:
        maps, pasts = self._store.hand_over(
            request.epoch, request.particles, FREEZE_SHARE * self._timeout_s, request.known
        )
        return srv.FetchMapsResponse(
            success=True, engine=self._engine, pasts=pasts, **_joined(maps)
        )

    @answers_bad_requests(srv.PrepareResamplingResponse)
    def _prepare(self, request: srv.PrepareResamplingRequest) -> srv.PrepareResamplingResponse:
        self._store.check_survey(request.survey)
        fetched = self._store.prepare(
            request.epoch, request.ancestors, self._peers.fetch, self._timeout_s
        )
        return srv.PrepareResamplingResponse(
            success=True, maps_fetched=fetched.maps, bytes_fetched=fetched.bytes
        )

    @answers_bad_requests(srv.CommitResamplingResponse)
    def _commit(self, request: srv.CommitResamplingRequest) -> srv.CommitResamplingResponse:
        self._store.check_survey(request.survey)
        decide = self._store.commit if request.commit else self._store.abort
        decide(request.epoch)
        return srv.CommitResamplingResponse(success=True)


def _joined(maps: list[bytes]) -> dict[str, Any]:
    """Fields of a response."""
    return {"sizes": [len(data) for data in maps], "maps": b"".join(maps)}
