"""The survey recorder: follows a survey from outside and writes its run folder at the end.

It alone listens to the ground truth, which the filter must never see.
"""

from __future__ import annotations

import time
from typing import Any

import rosbag
import roslib.message
import rospy
from geometry_msgs.msg import PoseStamped
from nav_msgs.msg import Path as PathMessage
from std_srvs.srv import Trigger, TriggerResponse

from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.evaluation.result_lines import summarise
from rbpf_svgp_slam.exports.after_run import export_after_run
from rbpf_svgp_slam.msg import FilterStatus, MapStatus
from rbpf_svgp_slam.parameters.loading import RecorderParameters, validate, validate_recorder
from rbpf_svgp_slam.parameters.rules import ParameterError
from rbpf_svgp_slam.parameters.server import parameter_tree
from rbpf_svgp_slam.protocol import names
from rbpf_svgp_slam.protocol.running_nodes import NameTaken, expect_free
from rbpf_svgp_slam.recorder.assembly import assemble_run
from rbpf_svgp_slam.recorder.ending import end_launch, way_out
from rbpf_svgp_slam.recorder.ground_truth import POSE_OF, GroundTruth
from rbpf_svgp_slam.recorder.lost_master import lost_master
from rbpf_svgp_slam.recorder.recording import Recording
from rbpf_svgp_slam.recorder.refusals import nothing_taken_in
from rbpf_svgp_slam.recorder.replay import OfflineReplay, PlayedBag, ProgressLine
from rbpf_svgp_slam.recorder.room_to_write import expect_no_earlier_run, expect_room
from rbpf_svgp_slam.recorder.seabed_publisher import SeabedPublisher
from rbpf_svgp_slam.recorder.so_far import SoFar
from rbpf_svgp_slam.recorder.survey_client import finish_survey
from rbpf_svgp_slam.recorder.time_lapse import TimeLapseRecorder
from rbpf_svgp_slam.run.run_files import save_run
from rbpf_svgp_slam.srv import RecordSurvey, RecordSurveyRequest, RecordSurveyResponse

NAME = "survey_recorder"
POLL_S = 0.1
PATH_PERIOD_S = 1.0
MASTER_PERIOD_S = 1.0
PATH_POSES = 4000
# With nodes that publish a status twice a second, or the core, on top of its own period.
STATUS_PATIENCE_S = 10.0
# With maps that have still to follow the last correction of the past, after the final training.
FOLLOWING_PATIENCE_S = 30.0
FAILURES = (RuntimeError, ValueError, OSError, rosbag.ROSBagException)
FAILURES += (rospy.ServiceException, rospy.ROSException)


def start() -> int | str:
    """Run the recorder to the survey's end; returns what sys.exit() takes."""
    try:
        expect_free(NAME)
    except NameTaken as error:
        return f"{NAME}: {error}"
    rospy.init_node(NAME)
    try:
        private = validate_recorder(rospy.get_param(rospy.get_name(), {}))
        if not (private.overwrite or private.resume):
            expect_no_earlier_run(private.out_dir, private.offline)
        expect_room(private.out_dir)
        recorder = Recorder(private, parameter_tree(NAME))
    except ParameterError as error:
        return f"{NAME}: {error}"
    status = recorder.run()
    end_launch(recorder.farewell, ending_already=rospy.is_shutdown())
    return status


class Recorder:
    """Keeps the ground truth and the filter's status; see run()."""

    def __init__(self, private: RecorderParameters, tree: dict[str, Any]) -> None:
        """tree: all parameters below `rbpf_svgp_slam/`; raises ParameterError."""
        parameters = validate(tree)
        self._private = private
        self._new_recording = lambda: Recording(
            out_dir=private.out_dir,
            parameters=parameters,
            parameter_tree=tree,
            terrain_file=private.terrain_file,
            ground_truth=GroundTruth(parameters.frames.map),
            time_lapse=TimeLapseRecorder(parameters),
        )
        self._recording = self._new_recording()
        #: To be said at the very end, whatever it is.
        self.farewell = ""
        self._saved = False
        nodes = range(parameters.nodes)
        # Statuses by sender.
        self._heard = {names.CORE: 0, **{names.map_node(k): 0 for k in nodes}}
        self._map_frame = parameters.frames.map
        self._path = rospy.Publisher(names.TRUTH_PATH, PathMessage, queue_size=1, latch=True)
        self._next_path_s = 0.0
        self._next_look_s = 0.0
        self._seabed = SeabedPublisher(self._map_frame)
        self._saving = False
        self._subscribers = [
            rospy.Subscriber("ground_truth", rospy.AnyMsg, self._on_ground_truth),
            rospy.Subscriber(names.FILTER_STATUS, FilterStatus, self._on_status),
        ] + [rospy.Subscriber(names.map_status(k), MapStatus, self._on_map_status) for k in nodes]
        self._save = rospy.Service("~save", Trigger, self._on_save)
        self._so_far = SoFar(lambda: self._recording, private.bag)
        if private.offline:
            self._record_service = rospy.Service("~record", RecordSurvey, self._on_record)

    def run(self) -> int:
        """Follow the survey to its end and write the run folder; returns the exit status.

        The last word on it is for `farewell`.
        """
        try:
            self._record()
        except FAILURES as error:
            # whatever fails without a master fails for want of it
            why = self._lost_master() or error
            rospy.logfatal("No report: %s", why)
            self.farewell = f"No report: {why}{self._way_out()}"
            return 1
        return 0

    def _lost_master(self) -> str:
        # once rospy shuts down it signs off itself
        return "" if rospy.is_shutdown() else lost_master(rospy.get_name())

    def _expect_master(self) -> None:
        if time.monotonic() < self._next_look_s:
            return
        self._next_look_s = time.monotonic() + MASTER_PERIOD_S
        if why := self._lost_master():
            raise RuntimeError(why)

    def _way_out(self) -> str:
        recording = self._recording
        if self._saved:
            return f". The run is saved: evaluate_run.py {recording.out_dir} makes one"
        if self._private.offline:
            return ""
        return way_out(recording.out_dir, recording.ground_truth)

    def _record(self) -> None:
        source = self._source()
        self._follow(source)
        if rospy.is_shutdown():
            raise RuntimeError("the launch was ended before the survey was over")
        if isinstance(source, OfflineReplay):
            self._recording.wall_s = source.wall_s()  # and it has seen to the final training
        else:
            self._finish_survey()
        self._await_last_words()
        if not self._recording.statuses[-1].pings:
            raise RuntimeError(nothing_taken_in(self._recording.statuses))
        self._so_far.writing.acquire()  # waits for one that is being written
        rospy.loginfo("Writing the report to %s", self._recording.out_dir)
        run = assemble_run(self._recording, self._private.bag, self._pings_lost(source))
        # At first, so that the data are safe whatever happens then.
        save_run(run, self._recording.out_dir)
        self._saved = True
        # Before the report, which takes its time: RViz ends with the launch.
        self._seabed.publish(run)
        figures = self._recording.parameters.output.figures
        report = write_report(run, self._recording.out_dir, figures=figures)
        export_after_run(self._recording.out_dir, run.config, rospy.logerr)
        self.farewell = summarise(report, self._recording.out_dir)

    def _source(self) -> PlayedBag | OfflineReplay | None:
        bag = self._private.bag
        if not bag:
            return None
        topics = {name: rospy.resolve_name(name) for name in ("odom", "mbes/pings")}
        if not self._private.offline:
            return PlayedBag(bag, topics["odom"], topics["mbes/pings"])
        source = OfflineReplay(bag, topics["odom"], topics["mbes/pings"])
        topic = rospy.resolve_name("ground_truth")
        for message, type_name in source.messages(topic, "ground truth"):
            self._take_ground_truth(message, type_name)
        return source

    def _pings_lost(self, source: PlayedBag | OfflineReplay | None) -> int:
        return source.lost(self._recording.statuses[-1]) if source else 0

    def _follow(self, source: PlayedBag | OfflineReplay | None) -> None:
        progress = ProgressLine()
        while not rospy.is_shutdown() and not self._saving:
            time.sleep(POLL_S)  # wall time: the bag's clock stands still once it is over
            self._expect_master()
            self._publish_path()
            if not self._recording.statuses:
                continue
            status = self._recording.statuses[-1]
            if not self._private.offline:
                self._recording.time_lapse.advance(status)
            if source is None:
                continue
            if isinstance(source, PlayedBag):
                progress.show(source.share_played(status), status)
            if source.is_over(status):
                break
        progress.end()

    def _finish_survey(self) -> None:
        statuses = self._recording.statuses
        if not statuses:
            raise RuntimeError("the core has not yet told of a survey")
        finish_survey(statuses[-1].survey)
        now_s = time.monotonic()
        self._recording.wall_s = now_s - (self._recording.started_s or now_s)
        rest_s = self._recording.parameters.output.final_training_s
        rospy.loginfo("Survey over; training on the whole log for %.0f s more.", rest_s)
        end_s = time.monotonic() + rest_s
        give_up_s = end_s + FOLLOWING_PATIENCE_S
        while time.monotonic() < end_s and not rospy.is_shutdown():
            time.sleep(POLL_S)
            # The end is not made of maps that have still to follow the last correction.
            if self._maps_lag() and time.monotonic() < give_up_s:
                end_s = max(end_s, time.monotonic() + 2 * POLL_S)
        if self._maps_lag():
            rospy.logwarn("The maps have not followed the last correction of the past.")

    def _maps_lag(self) -> bool:
        """Whether some node's maps are of an older past than the filter's."""
        past = self._recording.statuses[-1].past
        return any(status.past != past for status in self._recording.map_statuses.values())

    def _await_last_words(self) -> None:
        """Two more statuses of everybody: what is on its way now may be from before the end."""
        before = self._heard.copy()
        patience_s = STATUS_PATIENCE_S + 2.0 / self._recording.parameters.output.publish_rate_hz
        give_up_s = time.monotonic() + patience_s
        silent = list(before)
        while silent and time.monotonic() < give_up_s and not rospy.is_shutdown():
            time.sleep(POLL_S)
            silent = [name for name in before if self._heard[name] < before[name] + 2]
        if silent:
            rospy.logwarn("No news from %s for %.0f s.", ", ".join(silent), patience_s)

    def _on_ground_truth(self, message: rospy.AnyMsg) -> None:
        """Live: of any type, since a wrong one must be refused by name."""
        type_name = message._connection_header["type"]
        if type_name in POSE_OF:
            raw, message = message, roslib.message.get_message_class(type_name)()
            message.deserialize(raw._buff)
        self._take_ground_truth(message, type_name)

    def _take_ground_truth(self, message: Any, type_name: str) -> None:
        problem = self._recording.ground_truth.add(message, type_name)
        if problem:
            rospy.logerr_throttle(5.0, f"Ground truth refused: {problem}")

    def _on_status(self, status: FilterStatus) -> None:
        if not self._is_recorded(status.survey):
            rospy.logwarn("Another survey has begun: what was recorded before is dropped.")
            self._recording = self._new_recording()
        if status.odometry_messages and self._recording.started_s is None:
            self._recording.started_s = time.monotonic()
        self._recording.statuses.append(status)
        if not self._private.offline:
            self._recording.history.on_status(status)
        self._heard[names.CORE] += 1

    def _on_map_status(self, status: MapStatus) -> None:
        self._heard[names.map_node(status.node)] += 1
        if self._is_recorded(status.survey):
            self._recording.map_lives[status.node, status.restarts] = status
            if not self._private.offline:
                self._recording.history.on_map_status(status)

    def _on_record(self, survey: RecordSurveyRequest) -> RecordSurveyResponse:
        """Of an offline replay, which waits, and so do its map nodes."""
        for status in survey.maps:
            self._recording.history.on_map_status(status)
        self._recording.history.on_status(survey.status)
        self._recording.time_lapse.advance(survey.status)
        return RecordSurveyResponse()

    def _is_recorded(self, survey: int) -> bool:
        """Whether it is the survey that is being recorded; any is, before the first status."""
        statuses = self._recording.statuses
        return not statuses or statuses[-1].survey == survey

    def _on_save(self, _: Trigger) -> TriggerResponse:
        self._saving = True
        return TriggerResponse(
            success=True, message=f"writing the run to {self._recording.out_dir}"
        )

    def _publish_path(self) -> None:
        if time.monotonic() < self._next_path_s:
            return
        self._next_path_s = time.monotonic() + PATH_PERIOD_S
        rows = self._recording.ground_truth.thinned(PATH_POSES)
        if not rows:
            return
        path = PathMessage()
        path.header.frame_id = self._map_frame
        for stamp_s, x, y, z in rows:
            pose = PoseStamped()
            pose.header.stamp, pose.header.frame_id = rospy.Time(stamp_s), self._map_frame
            pose.pose.position.x, pose.pose.position.y, pose.pose.position.z = x, y, z
            pose.pose.orientation.w = 1.0
            path.poses.append(pose)
        self._path.publish(path)
