"""Sonar makers' files become surveys: readers, and what turns their angles and times into beams.

Only `import_command` and `degraded_bag` need ROS: they write bags.
"""
