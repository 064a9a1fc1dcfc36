"""What the data allow: the method and its rivals on many simulated surveys; `tools/study.sh`."""
