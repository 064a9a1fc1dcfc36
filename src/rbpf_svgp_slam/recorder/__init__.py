"""The survey recorder: follows a survey from outside and writes its run folder."""
