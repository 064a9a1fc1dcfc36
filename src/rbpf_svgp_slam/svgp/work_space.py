"""Buffers that all maps of one shape share within a thread, one after the other."""

from __future__ import annotations

import threading

import torch

from rbpf_svgp_slam.svgp.config import SvgpConfig
from rbpf_svgp_slam.svgp.objective import Objective

_thread = threading.local()


def objective(config: SvgpConfig, minibatch_size: int) -> Objective:
    """This thread's `Objective` for minibatches of M, so that a map costs only its parameters."""
    shape = (
        config.inducing_points,
        minibatch_size,
        config.kernel,
        config.jitter,
        getattr(torch, config.dtype),
        torch.device(config.device),
    )
    if getattr(_thread, "shape", None) != shape:
        _thread.objective = Objective(*shape)
        _thread.shape = shape
    return _thread.objective
