"""Sonar makers' files become surveys: readers, and what turns their angles and times into beams.

Only `import_command` needs ROS: it writes a bag.
"""
