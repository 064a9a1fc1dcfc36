"""How an SVGP map learns: by name, as in `svgp/optimizer`."""

from rbpf_svgp_slam.svgp.optimizers.adam import AdamOptimizer
from rbpf_svgp_slam.svgp.optimizers.natgrad import NaturalGradient
from rbpf_svgp_slam.svgp.optimizers.streaming import Streaming

OPTIMIZERS = {"adam": AdamOptimizer, "natgrad": NaturalGradient, "streaming": Streaming}
