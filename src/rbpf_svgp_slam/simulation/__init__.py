"""A seeded simulator of multibeam surveys: terrain, vehicle, sonar and dead reckoning.

Only `simulate_command` needs ROS: it writes a bag.
"""


class SurveyError(ValueError):
    """A mistake in what the user asked for; the message names the value and what was expected."""
