"""Reading any image, looking through another camera, finding what is in front of a plain background."""

import numpy as np
import pytest
from PIL import Image
from samples import single_line
from scipy.ndimage import gaussian_filter

from stereo_occ.calibration import Lens, RealCamera
from stereo_occ.errors import UserError
from stereo_occ.geometry.camera import Camera
from stereo_occ.geometry.crop import Box
from stereo_occ.photographs.locate import in_box, in_mask, on_plain_background
from stereo_occ.photographs.photo import developed, open_image, read_mask, seen_by

W, H = 48, 32
GREY = np.linspace(0, 255, W * H).reshape(H, W).astype(np.uint8)


def saved(path, array, mode=None):
    Image.fromarray(array, mode).save(path) if mode else Image.fromarray(array).save(path)
    return path


def read_photo(path, name):
    return developed([open_image(path, name)])[0]


@pytest.mark.parametrize("suffix", ["png", "tiff", "bmp", "pgm", "webp"])
def test_grey_images_of_any_format(suffix, tmp_path):
    path = tmp_path / f"Tasse ä 杯.{suffix}"
    Image.fromarray(GREY).save(path, **({"lossless": True} if suffix == "webp" else {}))
    photo = read_photo(path, "left")
    np.testing.assert_array_equal(photo.rgb_HW3, np.repeat(GREY[..., None], 3, axis=2))
    assert photo.size == (W, H)
    assert photo.mask_HW is None


@pytest.mark.parametrize("bits", [10, 12, 16])
def test_sixteen_bit_images_use_the_whole_range(bits, tmp_path):
    values = np.rint(GREY / 255 * (2**bits - 1)).astype(np.uint16)
    photo = read_photo(saved(tmp_path / "x.png", values), "left")
    np.testing.assert_array_equal(photo.rgb_HW3[..., 1], GREY)


def test_a_pair_of_sixteen_bits_keeps_its_brightness(tmp_path):
    """The darker image needs 10 bits alone, the brighter one 12."""
    images = [
        open_image(
            saved(tmp_path / f"{peak}.png", np.linspace(0, peak, W * H, dtype=np.uint16).reshape(H, W)), "x"
        )
        for peak in (1000, 4000)
    ]
    dark, bright = (photo.rgb_HW3.astype(float) for photo in developed(images))
    np.testing.assert_allclose(4 * dark, bright, atol=2.5)
    assert bright.max() == round(255 * 4000 / 4095)


def test_soft_and_compressed_masks_count_from_the_middle_on(tmp_path):
    hard = np.zeros((H, W), np.uint8)
    hard[8:24, 16:40] = 255
    soft = gaussian_filter(hard.astype(float), 1.5).astype(np.uint8)
    for path, levels in (("soft.png", soft), ("hard.jpg", hard), ("ones.png", hard // 255)):
        mask_HW = read_mask(saved(tmp_path / path, levels), "left_mask", (W, H))
        assert (mask_HW != (hard > 0)).sum() <= 8, path  # corners


def test_transparency_is_a_mask(tmp_path):
    rgba = np.dstack([GREY, GREY, GREY, np.zeros_like(GREY)])
    rgba[5:9, 10:20, 3] = 255
    photo = read_photo(saved(tmp_path / "x.png", rgba), "left")
    assert photo.mask_HW.sum() == 40
    assert photo.mask_HW[5:9, 10:20].all()
    opaque = read_photo(saved(tmp_path / "y.png", np.dstack([GREY] * 3 + [np.full_like(GREY, 255)])), "left")
    assert opaque.mask_HW is None


def test_photographs_are_turned_as_their_camera_noted(tmp_path):
    exif = Image.Exif()
    exif[0x0112] = 6  # turned by 90 degrees
    Image.fromarray(GREY).save(tmp_path / "x.png", exif=exif)
    assert read_photo(tmp_path / "x.png", "left").size == (H, W)


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (None, "no such file"),
        (b"text", "is no image"),
        (b"\x89PNG\r\n\x1a\n" + b"\0" * 40, "is no image|cannot be read"),
    ],
)
def test_no_images(content, complaint, tmp_path):
    path = tmp_path / "x.png"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(UserError, match=f"left={path}: ({complaint})") as raised:
        read_photo(path, "left")
    assert single_line(str(raised.value))


def test_a_shortened_image(tmp_path):
    path = saved(tmp_path / "x.png", np.random.default_rng(0).integers(256, size=(64, 64, 3), dtype=np.uint8))
    path.write_bytes(path.read_bytes()[:3000])
    with pytest.raises(UserError, match="cannot be read"):
        read_photo(path, "left")


@pytest.mark.parametrize(
    ("mask", "complaint"),
    [
        (np.zeros((H, W), np.uint8), "is empty"),
        (np.full((H, W), 255, np.uint8), "covers the whole image"),
        (np.full((H, W + 1), 255, np.uint8), "has 49 x 32 pixels, its image 48 x 32"),
    ],
)
def test_masks_that_say_nothing(mask, complaint, tmp_path):
    with pytest.raises(UserError, match=f"left_mask=.*{complaint}"):
        read_mask(saved(tmp_path / "m.png", mask), "left_mask", (W, H))


def ramp(width, height):
    """An image whose red is its u and whose green is its v."""
    v, u = np.mgrid[:height, :width]
    return np.stack([u, v], axis=-1).astype(np.uint8)


@pytest.mark.parametrize("distortion", [[], [-0.2, 0.05, 0.001, -0.002, 0.01]])
@pytest.mark.parametrize("side", [16, 64])
def test_a_crop_shows_every_point_where_the_crops_camera_does(distortion, side):
    K = np.array([[180.0, 0, 100], [0, 190, 80], [0, 0, 1]])
    camera = RealCamera(K, Lens.from_list(distortion), np.eye(4), (200, 160))
    target = Camera(
        np.array([[side * 2.5, 0, side * 0.4], [0, side * 2.5, side * 0.6], [0, 0, 1]]), np.eye(4), side, side
    )
    seen_HW2 = seen_by(ramp(200, 160), camera, target)
    v, u = np.mgrid[:side, :side]
    rays_N3 = np.stack([u, v, np.ones_like(u)], axis=-1).reshape(-1, 3) @ np.linalg.inv(target.K).T
    expected = camera.pixels_along(rays_N3).reshape(side, side, 2)
    np.testing.assert_allclose(seen_HW2, expected, atol=0.15)


def test_a_turned_camera_sees_the_same_directions():
    K = np.array([[180.0, 0, 100], [0, 180, 80], [0, 0, 1]])
    camera = RealCamera(K, Lens.from_list([]), np.eye(4), (200, 160))
    pose = np.eye(4)
    pose[:3, :3] = np.array([[np.cos(0.1), 0, -np.sin(0.1)], [0, 1, 0], [np.sin(0.1), 0, np.cos(0.1)]])
    target = Camera(np.array([[100.0, 0, 7.5], [0, 100, 7.5], [0, 0, 1]]), pose, 16, 16)
    middle = seen_by(ramp(200, 160), camera, target)[7:9, 7:9].mean(axis=(0, 1))
    np.testing.assert_allclose(middle, [100 + 180 * np.tan(0.1), 80], atol=0.2)


def test_beyond_the_image_are_the_edges_own_colours_or_what_is_asked():
    K = np.array([[20.0, 0, 9.5], [0, 20, 9.5], [0, 0, 1]])
    camera = RealCamera(K, Lens.from_list([]), np.eye(4), (20, 20))
    target = Camera(K + np.array([[0, 0, 10], [0, 0, 10], [0, 0, 0]]), np.eye(4), 40, 40)
    image = np.full((20, 20, 1), 200, np.uint8)
    assert (seen_by(image, camera, target) == 200).all()
    outside = seen_by(image, camera, target, outside=0)
    assert (outside[10:30, 10:30] == 200).all()
    assert outside[:9].max() == 0


def scene(box, background=230, size=(60, 90)):
    image = np.full((*size, 3), background, np.uint8)
    left, top, right, bottom = box
    image[top:bottom, left:right] = [60, 90, 40]
    return image


def test_what_stands_out_from_a_plain_background():
    found = on_plain_background(scene((20, 10, 50, 40)), "left")
    assert found.box == Box(19.5, 9.5, 49.5, 39.5)
    assert 890 <= found.mask_HW.sum() <= 900  # single pixels at corners are taken for noise


def test_small_things_apart_do_not_count():
    image = scene((20, 10, 50, 40))
    image[50:53, 70:73] = 0
    assert on_plain_background(image, "left").box == Box(19.5, 9.5, 49.5, 39.5)


def test_the_box_of_a_mask_is_the_masks():
    mask_HW = np.zeros((30, 40), bool)
    mask_HW[5:9, 10:12] = mask_HW[12, 3] = True
    assert in_mask(mask_HW).box == Box.of_mask(mask_HW)


def test_the_box_of_a_box_is_the_box():
    assert in_box([3, 4, 20, 10], (W, H), "left_box").box == Box(3, 4, 20, 10)
