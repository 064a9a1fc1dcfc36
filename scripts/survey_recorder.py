#!/usr/bin/env python3
"""Follows a survey and writes its run folder; see rbpf_svgp_slam/recorder/recorder.py."""

import sys

import rospy

from rbpf_svgp_slam.recorder.recorder import Recorder

if __name__ == "__main__":
    rospy.init_node("survey_recorder")
    sys.exit(Recorder().run())
