"""Slack, delay, gain and drift of a record, with their uncertainty: is the slack identified?

One model is fitted by least squares:

    m(t) = g P(c(t - d)) + b + drift(t)

P is the mean of plays whose half widths lie evenly in r (1 - k) .. r (1 + k): k = 0 is the play of
Eq. (1), k = 1 a loop without corners; in full strokes the loop is 2 r wide. A pure delay is r = 0.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from tautscope.analysis.delayed_play import Shape, Signals, turns
from tautscope.analysis.models.task import Floats

CONFIDENCE = 0.95
LARGEST_UNCERTAINTY = 0.1
"""Half the interval over the width, up to which a width is identified."""
LEAST_STROKES = 4
"""Times that the tip reverses, which is each time after the slack was crossed."""
SURROGATES, LARGEST_P = 199, 0.01
NEGLIGIBLE = 0.03
"""Largest slack that would not have been seen, as a share of the tip's range."""
LEAST_ADVANTAGE = 1.05
"""Error of a lag without slack, over that of the model."""
EARLY = 1.25
"""Error without a delay, over that of a tip before its command, which is one of the time stamps:
below it the tip's loop has other corners than those of the model."""
EXCHANGE = "exchange --command and --measured if they are swapped, or correct the time stamps"
"""What to do where a tip moves before its command."""
MOST_STROKES = 10
"""Times the strokes of a record that a person can be asked for."""
_LARGEST = 0.49
"""Largest half width, as a share of the command's range; at 0.5 the play never moves."""
_RADII = _LARGEST * (np.arange(24) / 24) ** 1.5
_BLOCKS = 20


@dataclass(frozen=True)
class Interval:
    """A value and its confidence interval of 95 %, by a jackknife over strokes."""

    value: float
    low: float
    high: float

    @property
    def half(self) -> float:
        """Half its length."""
        return (self.high - self.low) / 2


@dataclass(frozen=True, eq=False)
class Identification:
    """What a record says of the slack.

    Attributes:
        width: Backlash width [tip's unit].
        delay: Of the tip behind the command [s, or samples without a time].
        gain: Tip travel per command travel in contact.
        offset: b [tip's unit].
        radius: r [command's unit].
        rounding: k, in [0, 1].
        drift: (n,) offset over the record, mean 0 [tip's unit].
        predicted: (n,) output of the model.
        noise: RMS of measured minus predicted [tip's unit].
        explanations: RMS of what each part of the model leaves [tip's unit]; all may drift.
        strokes: Strokes of the tip: times that it reverses in the model, plus one.
        p_value: Share of surrogates, tips that have nothing to do with the command, that the model
            explains at least as well.
        is_at_limit: Whether width or delay is at the end of the search.
        stroke: Median time of a stroke of the command [s, or samples without a time].
    """

    width: Interval
    delay: Interval
    gain: float
    offset: float
    radius: float
    rounding: float
    drift: Floats
    predicted: Floats
    noise: float
    explanations: dict[str, float]
    strokes: int
    p_value: float
    is_at_limit: bool
    stroke: float

    @property
    def missing(self) -> str:
        """What the record lacks for its width to be known; empty if the width is identified."""
        return self._lack[0]

    @property
    def remedy(self) -> str:
        """What to record for the width to be known; empty if it is identified."""
        return self._lack[1]

    @property
    def _lack(self) -> tuple[str, str]:
        """What is missing, and what to do."""
        if self.strokes < LEAST_STROKES:
            return (
                f"the tip reverses {self.strokes - 1} times, and each of at least {LEAST_STROKES} "
                "strokes must cross the slack",
                "record at least ten strokes, back and forth, each several times as long as "
                "the slack",
            )
        if self.p_value > LARGEST_P:
            return (
                "the command explains the tip no better than a random walk (surrogate test, "
                f"p = {self.p_value:.2g})",
                "check that the two columns belong together, then record strokes several times "
                "as long as the slack",
            )
        if self.is_early and self.width.half > LARGEST_UNCERTAINTY * self.width.value:
            return "the tip moves before its command", EXCHANGE
        if self.explanations["a lag"] < LEAST_ADVANTAGE * self.noise:
            return (
                "a lag without slack explains the record as well",
                "record the same strokes at half the speed: a lag shrinks with it, slack does not",
            )
        if self.is_at_limit or not math.isfinite(self.width.high):
            limit = "the best fit is at the limit of the search"
            what = limit if self.is_at_limit else "the record fits any width"
            return what, "record longer and slower strokes"
        is_known = self.width.half <= LARGEST_UNCERTAINTY * self.width.value
        return ("", "") if is_known else self._doubt()

    def _doubt(self) -> tuple[str, str]:
        least = 1e-9 * self.width.half  # for a width of 0
        excess = self.width.half / (LARGEST_UNCERTAINTY * max(self.width.value, least))
        often = f"about {math.ceil(excess**2 * self.strokes)} strokes in place of {self.strokes}"
        if excess**2 > MOST_STROKES:
            often = "many more strokes, with all else at rest (other axes, endoscope, sensor)"
        return (
            f"it is between {self.width.low:.3g} and {self.width.high:.3g} (95 % interval), and "
            f"not known to ± {100 * LARGEST_UNCERTAINTY:.0f} %",
            f"record {often}, each several times as long as the slack, at two speeds",
        )

    @property
    def is_early(self) -> bool:
        """Whether the tip moves before its command, by more than clocks that differ a little.

        A lead by a share of a stroke hides a slack of about that share of the tip's range: up to
        `NEGLIGIBLE` of it nothing is lost by taking it for an offset of clocks.
        """
        return self.delay.high < -NEGLIGIBLE * self.stroke

    @property
    def is_related(self) -> bool:
        """Whether the command explains the tip, over strokes enough to say so."""
        return self.strokes >= LEAST_STROKES and self.p_value <= LARGEST_P

    @property
    def half_widths(self) -> Floats:
        """Of the plays [command's unit]."""
        return Shape(self.radius, self.rounding, 0.0).half_widths

    @property
    def is_identified(self) -> bool:
        """Whether the width is known well enough to compensate it."""
        return not self.missing

    @property
    def is_aligned(self) -> bool:
        """Whether the tip follows the command, and a slack would have been seen."""
        return (
            not self.is_identified
            and self.is_related
            and not self.is_at_limit
            and not self.is_early
            and self.width.value <= 2 * self.width.half
            and self.width.high <= NEGLIGIBLE * float(np.ptp(self.predicted - self.drift))
        )


def identify(time: Floats, command: Floats, measured: Floats) -> Identification:
    """Fit the model, and judge what it determines.

    Args:
        time: (n,), never decreasing; sample numbers if there is no time.
        command: (n,), not constant.
        measured: (n,), NaN where the tip is not known; not constant.
    """
    from scipy.optimize import least_squares  # noqa: PLC0415  takes a third of a second

    signals = Signals(time, command, measured)
    grid = _grid(signals)
    errors, p_value = _surrogate_test(signals, grid)

    scale = np.array([signals.extent, 1.0, signals.longest_delay])
    bounds = np.array([0.0, 0.0, -1.0]), np.array([_LARGEST, 1.0, 1.0])

    def shape(x: Floats) -> Shape:
        return Shape(*(x * scale).tolist())

    def refined(start: Shape, free: NDArray[np.bool_]) -> tuple[Floats, float]:
        begin = np.array([start.radius, start.rounding, start.delay]) / scale
        low, high = (bound[free] for bound in bounds)

        def full(x: Floats) -> Floats:
            values: Floats = begin.copy()
            values[free] = x
            return values

        found = least_squares(
            lambda x: signals.solve(shape(full(x)))[1],
            np.clip(begin[free], low + 1e-6, high - 1e-6),
            bounds=(low, high),
            diff_step=1e-3,
            x_scale=np.array([0.1, 0.3, 0.1])[free],
        )
        return full(found.x), float(np.sqrt(2 * found.cost / len(signals.target)))

    def best(allowed: list[bool]) -> tuple[Floats, float]:
        """Refined from the best of the grid, where the parameters that are not allowed are 0."""
        order = [
            k
            for k in np.argsort(errors).tolist()
            if (allowed[0] or grid[k].radius == 0)
            and (allowed[1] or grid[k].rounding == 0)
            and (allowed[2] or grid[k].delay == 0)
        ]
        if not any(allowed):
            return np.zeros(3), float(np.sqrt(errors[order[0]] / len(signals.target)))
        return min((refined(grid[k], np.array(allowed)) for k in order[:2]), key=lambda f: f[1])

    fits = {
        "a gain alone": best([False, False, False]),
        "a delay": best([False, False, True]),
        "a lag": (np.zeros(3), signals.lag_error()),
        "slack": best([True, False, False]),
        "slack and delay": best([True, False, True]),
    }
    start = fits["slack and delay"][0]
    fits["rounded slack and delay"] = min(
        (
            best([True, True, True]),
            refined(shape(start + np.array([0, 0.3, 0])), np.array([True, True, True])),
            fits["slack and delay"],
        ),
        key=lambda f: f[1],
    )
    x, error = fits["rounded slack and delay"]
    if x[2] < 0:
        at_once = np.array([True, True, False])
        other = refined(shape(x * at_once), at_once)
        if other[1] < EARLY * error:
            x, error = fits["rounded slack and delay"] = other
    found = shape(x)
    weights = signals.solve(found)[0]
    width, delay = _jackknife(signals, found)
    is_at_limit = x[0] > 0.98 * _LARGEST or abs(x[2]) > 0.98
    drift = np.interp(time, signals.time, signals.drifts[:, 1:] @ weights[2:])
    # The polynomials have no mean over the samples of the fit, which may lie otherwise in time.
    mean = float(drift.mean())
    return Identification(
        width=width,
        delay=delay,
        gain=float(weights[0]),
        offset=float(weights[1]) + mean,
        radius=found.radius,
        rounding=found.rounding,
        drift=drift - mean,
        predicted=weights[0] * signals.output(found, time) + weights[1] + drift,
        noise=error,
        explanations={name: error for name, (_, error) in fits.items()},
        strokes=len(_stroke_ends(signals, found)) + 1,
        p_value=p_value,
        is_at_limit=bool(is_at_limit),
        stroke=signals.stroke,
    )


def _grid(signals: Signals) -> list[Shape]:
    """Shapes of which the best are refined; successive ones share plays, and all nine delays."""
    return [
        Shape(share * signals.extent, rounding, delay)
        for share in _RADII.tolist()
        for rounding in ((0.0, 1.0) if share else (0.0,))
        for delay in (signals.longest_delay * np.linspace(-1, 1, 9)).tolist()
    ]


def _surrogate_test(signals: Signals, grid: list[Shape]) -> tuple[Floats, float]:
    """Squared error of each shape, and p-value of the best one.

    A surrogate has the increments of the tip, shuffled and with random signs: the tip as a random
    walk. The same search explains it.
    """
    keep = signals.where
    outputs = np.array([signals.output(shape)[keep] for shape in grid])
    base = np.linalg.qr(signals.drifts[keep])[0]
    rng = np.random.default_rng(0)
    target = signals.target
    steps = np.diff(target)
    walks = np.cumsum(
        [rng.permutation(steps) * rng.choice([-1, 1], len(steps)) for _ in range(SURROGATES)],
        axis=1,
    )
    tips = np.vstack([target, np.column_stack([np.zeros(SURROGATES), walks])])
    outputs -= outputs @ base @ base.T
    tips = tips - tips @ base @ base.T
    power = np.sum(outputs**2, axis=1)
    is_moving = power > 1e-12 * max(float(power.max()), 1e-300)
    gains = np.zeros((len(grid), len(tips)))
    gains[is_moving] = (outputs[is_moving] @ tips.T) ** 2 / power[is_moving, None]
    total = np.sum(tips**2, axis=1)
    explained = gains.max(axis=0) / np.maximum(total, 1e-300)
    p_value = (1 + int(np.sum(explained[1:] >= explained[0]))) / (SURROGATES + 1)
    return np.maximum(total[0] - gains[:, 0], 0.0), p_value  # rounding, where it is exact


def _stroke_ends(signals: Signals, shape: Shape) -> NDArray[np.intp]:
    """Samples at which the tip of the model reverses, by more than a ripple."""
    moved = signals.output(shape)
    return turns(moved, 0.02 * float(np.ptp(moved)))


def _jackknife(signals: Signals, shape: Shape) -> tuple[Interval, Interval]:
    """Intervals of width and delay: each block of strokes left out once, one Newton step each.

    Errors that are correlated within a stroke are thus counted once.
    """
    from scipy.stats import t as student  # noqa: PLC0415

    weights, residual = signals.solve(shape)
    gain = float(weights[0])
    steps = {
        "radius": 2e-3 * signals.extent,
        "rounding": 0.1,
        "delay": 0.01 * signals.longest_delay,
    }
    free = [name for name in steps if name != "rounding" or shape.radius > steps["radius"]]
    limits = {"radius": (0.0, np.inf), "rounding": (0.0, 1.0), "delay": (-np.inf, np.inf)}
    derivatives = []
    for name in free:
        value = getattr(shape, name)
        low, high = np.clip([value - steps[name], value + steps[name]], *limits[name]).tolist()
        outputs = [
            signals.output(Shape(**{**vars(shape), name: each}))[signals.where]
            for each in (low, high)
        ]
        derivatives.append(gain * (outputs[1] - outputs[0]) / (high - low))
    jacobian = np.column_stack([*derivatives, signals.columns(shape)[signals.where]])
    scale = np.linalg.norm(jacobian, axis=0) + 1e-300
    jacobian = jacobian / scale
    block = np.searchsorted(_stroke_ends(signals, shape), signals.where)
    count = int(block.max()) + 1
    if count > _BLOCKS:
        block = block * _BLOCKS // count
    used = np.unique(block)
    width, delay = 2 * shape.radius * abs(gain), shape.delay
    unknown = Interval(width, 0.0, np.inf), Interval(delay, -np.inf, np.inf)
    total = jacobian.T @ jacobian
    if len(used) < LEAST_STROKES or np.linalg.cond(total) > 1e10:
        return unknown
    changes = []
    for each in used:
        rows = jacobian[block == each]
        rest = total - rows.T @ rows
        if np.linalg.cond(rest) > 1e10:
            return unknown
        changes.append(np.linalg.solve(rest, rows.T @ residual[block == each]) / scale)
    table = np.array(changes)
    spread = np.sqrt((len(used) - 1) / len(used))
    quantile = float(student.ppf((1 + CONFIDENCE) / 2, len(used) - 1))
    by_width = 2 * (table[:, 0] * abs(gain) + shape.radius * np.sign(gain) * table[:, len(free)])
    by_delay = table[:, free.index("delay")]
    half = [
        quantile * spread * float(np.linalg.norm(each - each.mean()))
        for each in (by_width, by_delay)
    ]
    half[0] = float(np.hypot(half[0], 1e-3 * signals.extent * abs(gain) + signals.resolution / 2))
    return (
        Interval(width, max(width - half[0], 0.0), width + half[0]),
        Interval(delay, delay - half[1], delay + half[1]),
    )
