"""How an SVGP map learns: by name, as in `svgp/optimizer`."""

from rbpf_svgp_slam.svgp.optimizers.gradient import GradientAscent
from rbpf_svgp_slam.svgp.optimizers.natgrad import NaturalGradient
from rbpf_svgp_slam.svgp.optimizers.streaming import Streaming

OPTIMIZERS = {"adam": GradientAscent, "natgrad": NaturalGradient, "streaming": Streaming}
