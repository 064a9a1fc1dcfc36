"""The paper's three experiments (Torroba et al. 2023) on simulated surveys, beside its numbers."""


class ExperimentError(RuntimeError):
    """An experiment cannot be carried out as asked."""
