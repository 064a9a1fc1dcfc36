"""The run folder as it stands, for whoever asks while the survey goes on."""

from __future__ import annotations

import threading
import time
from dataclasses import replace
from typing import Callable

import rospy
from std_srvs.srv import Trigger, TriggerRequest, TriggerResponse

from rbpf_svgp_slam.evaluation.report import write_report
from rbpf_svgp_slam.exports.after_run import export_after_run
from rbpf_svgp_slam.recorder.assembly import assemble_run
from rbpf_svgp_slam.recorder.recording import Recording
from rbpf_svgp_slam.run.run_files import save_run


class SoFar:
    """Services ~save_so_far and ~export. They write in a thread of their own, one at a time."""

    def __init__(self, recording: Callable[[], Recording], bag: str) -> None:
        """recording: the present one; bag: empty for a live run."""
        self._recording = recording
        self._bag = bag
        #: Held while a run folder is being written, for good by whoever writes the final one.
        self.writing = threading.Lock()
        self._services = [
            rospy.Service("~save_so_far", Trigger, self._serve(self._save)),
            rospy.Service("~export", Trigger, self._serve(self._export)),
        ]

    def _serve(
        self, write: Callable[[Recording], str]
    ) -> Callable[[TriggerRequest], TriggerResponse]:
        """A service's handler. write: returns what it has written, and raises if it fails."""

        def handler(_: TriggerRequest) -> TriggerResponse:
            if not self.writing.acquire(blocking=False):
                return TriggerResponse(False, "the run folder is being written already")
            try:
                return TriggerResponse(True, write(self._recording()))
            except Exception as error:  # whatever it is: the survey goes on
                return TriggerResponse(False, str(error) or repr(error))
            finally:
                self.writing.release()

        return handler

    def _save(self, recording: Recording) -> str:
        if not recording.statuses or not recording.statuses[-1].pings:
            raise RuntimeError("no ping has been taken in")
        now_s = time.monotonic()
        so_far = replace(recording, wall_s=now_s - (recording.started_s or now_s))
        run = assemble_run(so_far, self._bag, is_over=False)
        save_run(run, so_far.out_dir)
        write_report(run, so_far.out_dir, figures=so_far.parameters.output.figures)
        return f"{len(run.stamp_s)} pings, {len(run.levelled)} beams written to {so_far.out_dir}"

    def _export(self, recording: Recording) -> str:
        if not recording.parameter_tree.get("survey_origin"):
            raise RuntimeError(
                "survey_origin is not set; expected the latitude and longitude of map's origin"
            )
        written = self._save(recording)
        complaints: list[str] = []
        files = export_after_run(recording.out_dir, recording.parameter_tree, complaints.append)
        if complaints:
            raise RuntimeError("; ".join(complaints))
        return f"{written}, {len(files)} products to {recording.out_dir / 'export'}"
