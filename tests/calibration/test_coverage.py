"""Choice and coverage of views: refused when poor, with what to show next."""

import cv2
import numpy as np
import pytest
from boards import BOARD, CONFIG, SIZE, rendered
from tautscope.calibration.camera import coverage
from tautscope.calibration.camera.board import MODULES
from tautscope.calibration.camera.coverage import LEAST_VIEWS, Coverage, ViewCollector
from tautscope.errors import CalibrationError
from tautscope.twin.board import BoardCamera

Image = np.ndarray


def camera() -> BoardCamera:
    return BoardCamera(CONFIG, BOARD.texture(10), BOARD.square / (10 * MODULES))


def posed(camera: BoardCamera, turn: tuple[float, float, float], share: float = 0.5) -> Image:
    """An image of the board in the middle of the view, turned about its centre."""
    width, height = BOARD.columns * BOARD.square, BOARD.rows * BOARD.square
    depth = CONFIG.camera.fx * width / (share * SIZE[0])
    rotation, _ = cv2.Rodrigues(np.array(turn))
    corner = np.array([0, 0, depth]) - rotation @ np.array([width / 2, height / 2, 0])
    return camera.draw(turn, corner, 0)


def collector(is_stream: bool = False) -> ViewCollector:
    return ViewCollector(BOARD, SIZE, is_stream=is_stream)


def test_many_poses_suffice() -> None:
    views = collector()
    for image in rendered(CONFIG, 20):
        views.offer(image)
    views.check()
    assert views.coverage.covered.all()
    assert views.status().endswith("complete")


@pytest.mark.parametrize("turn", [(0, 0.5, 0), (0, -0.5, 0), (0.5, 0, 0), (-0.5, 0, 0)])
def test_a_tilt_is_recognised(turn: tuple[float, float, float]) -> None:
    rotation, _ = cv2.Rodrigues(np.array(turn, float))
    # Change of depth with x (to the right) and y (down) of the board.
    across, down, _ = rotation[2]
    nearer = "left" if across > 0.1 else "right" if across < -0.1 else ""
    nearer = nearer or ("upper" if down > 0 else "lower")
    coverage = Coverage(SIZE, BOARD)
    view = BOARD.find(cv2.cvtColor(posed(camera(), turn), cv2.COLOR_BGR2GRAY))
    assert view is not None
    coverage.add(view)
    assert coverage.tilts == {**dict.fromkeys(coverage.tilts, 0), nearer: 1}


def test_poor_coverage_says_what_to_show() -> None:
    views, scene = collector(), camera()
    for k in range(LEAST_VIEWS):
        views.offer(posed(scene, (0.0, 0.0, 0.01 * k)))
    with pytest.raises(CalibrationError) as refused:
        views.check()
    text = str(refused.value)
    assert "upper left" in text
    assert "left or right or upper or lower edge nearer" in text


@pytest.mark.parametrize(
    ("image", "reason"),
    [
        (np.full((SIZE[1], SIZE[0], 3), 80, np.uint8), "without the board"),
        (np.full((SIZE[1], SIZE[0], 3), 255, np.uint8), "overexposed"),
        (np.full((480, 640, 3), 80, np.uint8), "not of the size 720 x 576"),
    ],
)
def test_unusable_images_are_counted_by_reason(image: Image, reason: str) -> None:
    views = collector()
    assert not views.offer(image)
    with pytest.raises(CalibrationError, match=f"1 images {reason}"):
        views.check()


def test_an_overexposed_board_is_not_used() -> None:
    views = collector()
    image = posed(camera(), (0.0, 0.0, 0.0)).astype(float)
    assert views.offer(image.astype(np.uint8))
    assert not views.offer(np.clip(image * 1.5, 0, 255).astype(np.uint8))
    assert views.rejected == {"overexposed": 1}


def test_a_stream_gives_views_at_rest_that_differ() -> None:
    views, scene = collector(is_stream=True), camera()
    first, second, third = (posed(scene, (0.0, 0.5, 0.1 * k), 0.4 + 0.2 * k) for k in range(3))
    taken = [views.offer(image) for image in (first, first, first, second, third, third)]
    assert taken == [False, True, False, False, False, True]
    assert views.rejected == {"with the board in motion": 3, "like others": 1}


def test_a_stream_with_enough_views_still_gives_those_that_are_lacking(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(coverage, "MOST_VIEWS", 1)
    views, scene = collector(is_stream=True), camera()
    for turn, share, is_taken in (
        ((0.0, 0.0, 0.0), 0.5, True),
        ((0.0, 0.0, 0.0), 0.4, False),
        ((0.0, 0.5, 0.0), 0.7, True),
        ((0.0, 0.5, 0.0), 0.3, True),
    ):
        image = posed(scene, turn, share)
        views.offer(image)
        assert views.offer(image) == is_taken, (turn, share)
    assert views.rejected["beyond the number needed"] == 2
