# SPDX-License-Identifier: Apache-2.0
"""Images, camera infos and maps as messages of ROS."""

import numpy as np
import pytest

import egosgm
from egosgm import bag as bags
from egosgm.bag import ros_images
from bag_case import FRAMES, HEIGHT, OPTIONS, SEED, START, WIDTH, Recording, png_of  # noqa: F401  some for the fixtures
from refusals import expect_refused


@pytest.mark.parametrize("model, distortion", [("radtan", [0.01, 0, 0, 0]), ("fisheye", [0.01, 0, 0, 0]), ("equidistant", [0.01, 0, 0, 0, 0])])
def test_distortions_by_the_names_that_drivers_give_them(model, distortion, street, frames):
    recording = Recording("mcap")
    recording.info("/left/camera_info", street.calibration, 0, distortion=distortion)
    recording.info("/right/camera_info", street.calibration, 1, distortion=distortion)
    infos = [item[3] for item in recording.messages]
    for info in infos:
        info.distortion_model = model
    named = ros_images.Cameras(*infos, True).rectified(frames[0].left, frames[0].right)
    for info in infos:
        info.distortion_model, info.d = ("plumb_bob", info.d) if model == "radtan" else ("equidistant", info.d[:4])
    for image, expected in zip(named, ros_images.Cameras(*infos, True).rectified(frames[0].left, frames[0].right)):
        np.testing.assert_array_equal(image, expected)


def test_encodings_give_the_same_grey(street, frames):
    recording = Recording("mcap")
    grey = frames[0].left

    def read(pixels, encoding):
        recording.messages.clear()
        recording.image("/x", START, pixels, encoding)
        return ros_images.grey_of(recording.messages[0][3])

    padded = np.pad(grey, ((0, 0), (0, 13)))
    recording.image("/x", START, padded, "mono8")
    message = recording.messages[0][3]
    message.width = WIDTH
    np.testing.assert_array_equal(ros_images.grey_of(message), grey)
    for encoding, channels in (("rgb8", 3), ("bgr8", 3), ("rgba8", 4), ("bgra8", 4)):
        np.testing.assert_array_equal(read(np.repeat(grey[:, :, None], channels, axis=2), encoding), grey)
    red = np.zeros((2, 2, 3), np.uint8)
    red[:, :, 0] = 255
    assert (read(red, "rgb8") == 76).all() and (read(red, "bgr8") == 29).all()
    wide = grey.astype(np.uint16) * 257
    assert read(wide, "mono16").dtype == np.uint16
    np.testing.assert_array_equal(read(wide, "mono16"), wide)
    yuv = np.stack([grey, np.full_like(grey, 128)], axis=2)
    np.testing.assert_array_equal(read(yuv, "yuyv"), grey)
    np.testing.assert_array_equal(read(yuv[:, :, ::-1], "uyvy"), grey)
    np.testing.assert_array_equal(read(np.repeat(grey[:, :, None], 4, axis=2), "8UC4"), grey)
    expect_refused("32FC1", lambda: read(grey.astype(np.float32), "32FC1"))
    message.step = WIDTH - 1
    expect_refused("rows of", lambda: ros_images.grey_of(message))


@pytest.mark.parametrize("order", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_images_are_grey_to_their_border(order):
    recording = Recording("mcap")
    values = dict(r=200, g=100, b=40)
    mosaic = np.empty((8, 10), np.uint8)
    for i, colour in enumerate(order):
        mosaic[i // 2::2, i % 2::2] = values[colour]
    for scale, bits, dtype in ((1, 8, np.uint8), (256, 16, np.uint16)):
        recording.messages.clear()
        recording.image("/x", START, mosaic.astype(dtype) * scale, f"bayer_{order}{bits}")
        grey = ros_images.grey_of(recording.messages[0][3])
        assert grey.dtype == dtype and (grey == (200 + 2 * 100 + 40) // 4 * scale).all()


def test_compressed_images_are_read(tmp_path, street, frames):
    recording = Recording("mcap")
    egosgm.write_disparity(tmp_path / "left.png", frames[0].left.astype(np.float32))
    expected = egosgm.read_grey(tmp_path / "left.png")
    for name, data in (("left", (tmp_path / "left.png").read_bytes()), ("right", (tmp_path / "left.png").read_bytes())):
        recording.info(f"/{name}/camera_info", street.calibration, name == "right")
        recording.add(f"/{name}/image_rect/compressed", "sensor_msgs/msg/CompressedImage", START, format="png", data=np.frombuffer(data, np.uint8))
    path = recording.write(tmp_path / "drive")
    frame, = bags.Bag(path, "/left/image_rect/compressed", "/right/image_rect/compressed").frames()
    np.testing.assert_array_equal(frame.left, expected)
    recording.messages[-1][3].data = np.frombuffer(b"no image at all", np.uint8)
    expect_refused("compressed image .png. cannot be read", lambda: ros_images.grey_of(recording.messages[-1][3]))


def test_a_mosaic_that_was_compressed():
    pixels = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8)
    expected = ros_images._of_bayer(pixels)
    message = type("CompressedImage", (), dict(format="bayer_rggb8; png compressed ", data=png_of(pixels)))()
    np.testing.assert_array_equal(ros_images.grey_of(message), expected)
    for plain in ("bayer_rggb8; png compressed bgr8", "mono8; png compressed ", "png"):
        message.format = plain
        np.testing.assert_array_equal(ros_images.grey_of(message), pixels)


def test_raw_images_are_rectified_by_their_infos(street):
    """Points of raw cameras that are turned against each other come to lie in equal rows."""
    angle = 0.02
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    recording = Recording("mcap")
    recording.info("/left/camera_info", street.calibration, 0, distortion=(0.1, 0.01, 0, 0, 0))
    recording.info("/right/camera_info", street.calibration, 1, rotation=turn)
    left, right = (item[3] for item in recording.messages)
    assert ros_images.are_raw(left, "/left/image_raw") and not ros_images.are_raw(left, "/left/image_rect")
    assert ros_images.are_raw(right, "/direct/image_raw") and not ros_images.are_raw(left, "/left/rectified/compressed")
    assert ros_images.are_raw(right, "/right/image") and not ros_images.are_raw(right, "/camera/infra1/image_rect_raw")
    cameras = ros_images.Cameras(left, right, True)
    assert cameras.calibration.baseline_m == pytest.approx(street.calibration.baseline_m)
    points = np.array([[0.5, 0.1, 4.0], [-1.0, -0.2, 6.0], [2.0, 0.3, 9.0]])
    c = street.calibration
    raw = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    for point, value in zip(points, (255, 200, 150)):
        for side in (0, 1):
            x, y, z = (point - [c.baseline_m, 0, 0]) @ turn if side else point  # R takes raw to rectified
            x, y = x / z, y / z
            if not side:
                r = x * x + y * y
                x, y = x * (1 + 0.1 * r + 0.01 * r * r), y * (1 + 0.1 * r + 0.01 * r * r)
            u, v = c.fx * x + c.cx, c.fy * y + c.cy
            grid_y, grid_x = np.mgrid[:HEIGHT, :WIDTH]
            spot = value * np.exp(-((grid_x - u) ** 2 + (grid_y - v) ** 2) / 8)
            raw[side] = np.maximum(raw[side], spot.astype(np.uint8))
    rectified = cameras.rectified(raw[0], raw[1])
    for point, value in zip(points, (255, 200, 150)):
        places = []
        for side, image in enumerate(rectified):
            x = cameras.calibration.fx * (point[0] - side * c.baseline_m) / point[2] + cameras.calibration.cx + side * cameras.calibration.doffs_px
            y = cameras.calibration.fy * point[1] / point[2] + cameras.calibration.cy
            # The library turns both cameras by half of what they are turned against each other: two rows here.
            top, first = max(0, int(y) - 7), max(0, int(x) - 7)
            window = image[top:top + 15, first:first + 15].astype(float)
            weight = np.where(window > 40, window, 0)
            places.append((top + (weight.sum(1) @ np.arange(window.shape[0])) / weight.sum(),
                           first + (weight.sum(0) @ np.arange(window.shape[1])) / weight.sum()))
        assert places[0][0] == pytest.approx(places[1][0], abs=0.3)
        assert places[0][1] - places[1][1] == pytest.approx(cameras.calibration.fx * c.baseline_m / point[2] - cameras.calibration.doffs_px, abs=0.5)


@pytest.mark.filterwarnings("error")
def test_next_to_no_disparity_is_infinitely_uncertain(street):
    depth, variance = ros_images.depth_maps(np.full((1, 1), 1e-20, np.float32), np.ones((1, 1), np.float32), street.calibration)
    assert depth[0, 0] > 1e20 and np.isinf(variance[0, 0])


@pytest.mark.parametrize("per_mille", [0, 1, 4, 8])
def test_highlights_of_sixteen_bits_cost_no_motion(per_mille, street, frames):
    """A lamp, many times as bright as the rest."""
    odometry = egosgm.StereoOdometry(street.calibration)
    side = int((WIDTH * HEIGHT * per_mille / 1000) ** 0.5)
    for i, frame in enumerate(frames):
        images = [image.astype(np.uint16) * 16 for image in (frame.left, frame.right)]
        for image in images:
            image[5:5 + side, 150:150 + side] = 65535
        assert (odometry.process(*images).motion is not None) == (i > 0)
