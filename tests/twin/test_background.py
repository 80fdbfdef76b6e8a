"""Background images of the simulated camera."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from tautscope.errors import MissingPathError
from tautscope.twin.tissue import draw_mucosa, load_backgrounds


def test_mucosa_depends_on_its_seed_alone() -> None:
    one = draw_mucosa(240, 192, 3)
    np.random.default_rng(0).normal(size=10)
    np.testing.assert_array_equal(one, draw_mucosa(240, 192, 3))
    assert (one != draw_mucosa(240, 192, 4)).mean() > 0.5


@pytest.mark.parametrize("seed", range(5))
def test_mucosa_looks_like_tissue_and_not_like_a_marker(seed: int) -> None:
    image = draw_mucosa(720, 576, seed)
    assert image.shape == (576, 720, 3)
    assert image.dtype == np.uint8
    blue, green, red = (float(value) for value in image.reshape(-1, 3).mean(axis=0))
    assert 110 < red < 230, f"seed {seed}"
    assert red > 1.4 * green > 1.4 * 0.9 * blue, f"seed {seed}"
    assert (image.min(axis=-1) > 225).mean() > 5e-4, f"seed {seed}: no wet highlights"
    assert (image.max(axis=-1) < 75).mean() > 5e-3, f"seed {seed}: no lumen"
    levels = image.astype(int)
    assert not (levels[..., 1] > levels[..., 2] + 10).any(), f"seed {seed}: something green"


@pytest.mark.parametrize("size", [(1, 1), (7, 90), (1920, 1080)])
def test_mucosa_of_any_size(size: tuple[int, int]) -> None:
    assert draw_mucosa(*size, seed=0).shape == (size[1], size[0], 3)


def test_a_folder_is_read_by_name_and_resized(tmp_path: Path) -> None:
    red, blue = np.zeros((20, 30, 3), np.uint8), np.zeros((500, 900, 3), np.uint8)
    red[..., 2], blue[..., 0] = 200, 200
    cv2.imwrite(str(tmp_path / "2.PNG"), red)
    cv2.imwrite(str(tmp_path / "1.jpg"), blue)
    (tmp_path / "0.png").write_bytes(b"not an image")
    (tmp_path / "README.md").write_text("not one either")
    first, second = load_backgrounds(tmp_path, 60, 40)
    assert first.shape == second.shape == (40, 60, 3)
    assert first[..., 0].mean() > 150 > first[..., 2].mean()
    assert second[..., 2].mean() > 150 > second[..., 0].mean()


def test_a_folder_without_images_is_rejected(tmp_path: Path) -> None:
    (tmp_path / "x.png").write_bytes(b"not an image")
    for folder in (tmp_path / "nowhere", tmp_path, tmp_path / "x.png"):
        with pytest.raises(MissingPathError) as caught:
            load_backgrounds(folder, 60, 40)
        assert caught.value.field == "twin.background"
        assert caught.value.value == str(folder)
