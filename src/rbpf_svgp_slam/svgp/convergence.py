"""When a map that never stops training is good enough to be matched against."""

from __future__ import annotations

import math
from collections import deque

#: A map that is ready stays so until the change exceeds this multiple of the tolerance, so that
#: the minibatches' noise does not switch a map near the tolerance on and off.
HYSTERESIS = 2.0
#: An average of less weight is not compared with others. It is one of few values: it is noisy, and
#: it lags less behind a rising ELBO than later ones do, so that the change would look too small.
MATURE_WEIGHT = 0.9


class Convergence:
    """Watches an exponential moving average of the ELBO per datum.

    A map is ready while the average's change over the last `window` steps stays small:

        |average now − average then| < tolerance · max(1 nat, |average now|)

    The change counts in both directions: a falling ELBO, as when new relief comes in, is no more
    converged than a rising one. The ELBO per datum is the logarithm of a density: its
    differences, in nats, do not depend on the unit of depth, but its value does and may well be
    zero. Hence the change is relative for values beyond one nat and absolute below.
    """

    def __init__(self, decay: float, window: int, tolerance: float) -> None:
        self.decay = decay
        self.tolerance = tolerance
        self.ready = False
        #: Average before its bias is corrected, and the weight that it has gathered so far.
        self.raw_average = 0.0
        self.weight = 0.0
        #: Mature averages after each of the last window + 1 steps, oldest first.
        self.averages: deque[float] = deque(maxlen=window + 1)

    @property
    def average(self) -> float:
        """The moving average, nats; NaN before the first value."""
        return self.raw_average / self.weight if self.weight > 0.0 else math.nan

    def update(self, elbo: float) -> None:
        """Take in the ELBO per datum [nats] of one more minibatch."""
        # average = Σ decayᵏ·ELBO₋ₖ / Σ decayᵏ: without bias from the first step on
        self.raw_average = self.decay * self.raw_average + (1.0 - self.decay) * elbo
        self.weight = self.decay * self.weight + (1.0 - self.decay)
        if self.weight > MATURE_WEIGHT:
            self.averages.append(self.average)
        self.ready = self._relative_change() < self.tolerance * (HYSTERESIS if self.ready else 1.0)

    def _relative_change(self) -> float:
        """Change over the window; infinite while the window is not full."""
        if len(self.averages) < self.averages.maxlen:
            return math.inf
        then, now = self.averages[0], self.averages[-1]
        return abs(now - then) / max(1.0, abs(now))
