"""Surveys as rosbags, whether simulated or imported."""
