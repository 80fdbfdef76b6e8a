"""Images as a camera delivers them: stamps, rolling shutter, exposure, compression."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from shapes import NO_INSTRUMENT, QUIET, Array, bent, make
from tautscope.config import Config
from tautscope.errors import ConfigError
from tautscope.loop.rig import Frame
from tautscope.twin import Twin
from tautscope.twin.sensor import Readout, compress

POSTURE = np.array([0.025, 0.0, 0.9])


def frames(seconds: float, **changes: Any) -> list[tuple[float, Frame]]:
    """Time of arrival and frame of a run at constant speed."""
    rig = Twin(Config().replace(**changes))
    times = np.arange(round(seconds / rig.control_period)) * rig.control_period
    speed = np.array([0.03, 0, 0.5])
    samples = [rig.reset(), *(rig.step(POSTURE + time * speed) for time in times)]
    return [(each.time, each.frame) for each in samples if each.frame is not None]


def test_a_stamp_error_changes_the_stamps_alone() -> None:
    right, wrong = (frames(0.6, **{"twin.sensor.stamp_error": error}) for error in (0.0, 0.02))
    assert len(right) > 8
    for (time, frame), (other_time, other) in zip(right, wrong, strict=True):
        assert time == other_time
        assert other.captured_at - frame.captured_at == pytest.approx(0.02)
        np.testing.assert_array_equal(frame.image, other.image)


@pytest.mark.parametrize("readout", [0.01, 0.03])
def test_a_rolling_shutter_skews_what_moves(readout: float) -> None:
    """A row at v is captured (v / height - 1/2) readout after the middle one."""
    config, camera = make(**QUIET)
    speed = 0.08
    points, tangents = bent(config, 22e-3, 0.3, 0.9)
    across = np.array([1.0, 0.0, 0.0])

    def at(time: float) -> tuple[Array, Array]:
        return points + speed * time * across, tangents

    shutter = Readout(readout)
    for time in np.arange(0, 0.2, 0.005):
        shutter.add(time, at(time))
    middle = time - readout / 2
    skewed = camera.draw_strips(shutter.strips(), 0).image
    tissue = camera.draw(*NO_INSTRUMENT, 0).image
    height = config.camera.height

    def centres(image: Array) -> Array:
        """Column of the centroid of the instrument in each row."""
        mask = (image != tissue).any(axis=2)
        with np.errstate(invalid="ignore"):
            return (mask * np.arange(mask.shape[1])).sum(axis=1) / mask.sum(axis=1)

    rows = np.flatnonzero(np.isfinite(centres(skewed)))[5:-5]
    for row in rows[::20]:
        still = camera.draw(*at(middle + readout * (row / height - 0.5)), 0).image
        moved = camera.draw(*at(middle), 0).image
        assert centres(skewed)[row] == pytest.approx(centres(still)[row], abs=1.0)
    shift = np.abs(centres(skewed)[rows] - centres(moved)[rows]).max()
    assert shift > (1.0 if readout < 0.02 else 3.0), "the skew is more than the tolerance"


def test_each_strip_of_a_rolling_shutter_is_that_of_a_still_image() -> None:
    config, camera = make(**QUIET)
    points, tangents = bent(config, 22e-3, 0.3, 0.9)
    strips = [(points + k * np.array([1e-3, 2e-3, 0.0]), tangents) for k in range(5)]
    rolled = camera.draw_strips(strips, 0).image
    height = config.camera.height
    for k, strip in enumerate(strips):
        rows = slice(round(height * k / 5), round(height * (k + 1) / 5))
        np.testing.assert_array_equal(rolled[rows], camera.draw(*strip, 0).image[rows])


def test_the_stamp_is_the_time_of_the_middle_row() -> None:
    """The truth of a frame with a rolling shutter is that of a still image at its stamp."""
    still = {f.captured_at: f.true_features for _, f in frames(1.0, **{"twin.frame_rate": 200.0})}
    rolling = {"twin.frame_rate": 20.0, "twin.sensor.readout": 0.04}
    rolled = [f for _, f in frames(1.0, **rolling)][5:-1]
    times = np.array(list(still))
    for frame in rolled:
        assert frame.true_features is not None
        for k, feature in enumerate(frame.true_features):
            expected = np.interp(frame.captured_at, times, [each[k] for each in still.values()])
            assert feature == pytest.approx(expected, abs=0.3)
    moved = np.abs(rolled[0].true_features - still[times[np.abs(times - 0.25).argmin()]]).max()
    assert moved > 0.3, "a stamp of the last row would be wrong"


def test_automatic_exposure_follows_its_target(tmp_path: Path) -> None:
    """log(mean / target) decays by exp(-frame period / time constant) per frame."""
    cv2.imwrite(str(tmp_path / "grey.png"), np.full((40, 60, 3), 60, np.uint8))
    _, camera = make(
        **QUIET,
        **{
            "twin.background": str(tmp_path),
            "twin.sensor.exposure_time_constant": 0.2,
            "twin.sensor.exposure_target": 120.0,
        },
    )
    means = [camera.draw(*NO_INSTRUMENT, k).image.mean() for k in range(20)]
    expected = 120 * 0.5 ** (np.exp(-1 / (25 * 0.2)) ** np.arange(20))
    np.testing.assert_allclose(means, expected, atol=1.5)
    camera.reset()
    assert camera.draw(*NO_INSTRUMENT, 0).image.mean() == pytest.approx(60)


def test_compression_quantises_the_cosine_transform() -> None:
    """At quality 50 the luminance coefficients are multiples of table K.1 of ITU-T T.81."""
    table = {(0, 0): 16, (0, 1): 11, (1, 0): 12, (1, 1): 12, (7, 7): 99}
    rng = np.random.default_rng(3)
    grey = rng.integers(60, 190, (64, 64), dtype=np.uint8)
    image = compress(np.repeat(grey[:, :, None], 3, axis=2), 50)
    level = image[:, :, 1].astype(np.float32) - 128
    for row in range(0, 64, 8):
        for column in range(0, 64, 8):
            block = cv2.dct(level[row : row + 8, column : column + 8])
            for place, step in table.items():
                count = block[place] / step
                assert abs(count - round(float(count))) < 0.2


def test_compression_blurs_colour_and_can_be_off() -> None:
    config, camera = make(**QUIET, **{"twin.sensor.jpeg_quality": 60})
    clean = make(**QUIET)[1].draw(*bent(config, 22e-3, 0.3, 0.9), 0)
    packed = camera.draw(*bent(config, 22e-3, 0.3, 0.9), 0)
    np.testing.assert_array_equal(packed.true_features, clean.true_features)
    assert 0.5 < np.abs(packed.image.astype(float) - clean.image).mean() < 5


def test_a_readout_longer_than_a_frame_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"twin\.sensor\.readout: got 0\.03"):
        Config().replace(**{"twin.frame_rate": 60.0, "twin.sensor.readout": 0.03})
