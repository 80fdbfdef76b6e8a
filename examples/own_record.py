"""The hysteresis estimator on your own record: no camera, no robot, any unit.

Here the record is simulated: a drive moves by two sines, the tip has a backlash of 3 mm, and its
position is measured with noise. Run it with ``uv run python examples/own_record.py``.
"""

import numpy as np
from tautscope import Estimator, Play, replay
from tautscope.metrics import rms


def main() -> None:
    angle = np.linspace(0, 60, 4000)
    command = 8 * np.sin(angle) + 3 * np.sin(2.7 * angle)
    tip = Play(delta_minus=-1.0, delta_plus=2.0).run(command)
    measured = tip + np.random.default_rng(0).normal(0, 0.05, len(tip))

    estimator = Estimator(
        update_distance=0.2,  # about 1 % of the stroke, well above the noise
        contact_tolerance=0.4,
        smoothing_factor=0.25,
        delta_minus=0.0,
        delta_plus=0.0,
    )
    predicted, delta_minus, delta_plus = replay.predict_tip(command, measured, estimator)

    late = slice(len(command) // 2, None)
    print(f"offsets {delta_minus[-1]:.2f} and {delta_plus[-1]:.2f} mm")
    print(f"error without a model: {rms((command - measured)[late]):.2f} mm RMS")
    print(f"error of prediction:   {rms((predicted - measured)[late]):.2f} mm RMS")


if __name__ == "__main__":
    main()
