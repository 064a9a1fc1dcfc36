#!/usr/bin/env python3
"""Follows a survey and writes its run folder; see rbpf_svgp_slam/recorder/recorder.py."""

import sys

import rospy

from rbpf_svgp_slam.recorder.ending import end_launch
from rbpf_svgp_slam.recorder.recorder import Recorder

if __name__ == "__main__":
    rospy.init_node("survey_recorder")
    recorder = Recorder()
    status = recorder.run()
    end_launch(recorder.farewell, ending_already=rospy.is_shutdown())
    sys.exit(status)
