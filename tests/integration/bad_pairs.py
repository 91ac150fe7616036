"""Pairs, calibrations and settings that ``reconstruct`` cannot take, and what it says of each."""

import json
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from PIL import Image

from stereo_occ.calibration.fields import Fields

WIDTH, HEIGHT = 960, 540  # of the example pair


@dataclass(frozen=True)
class Case:
    """One mistake.

    Attributes:
        arguments: in place of those of a command that works, by key.
        message: what the line must match.
        prepare: puts the mistake into the folder of the command.
    """

    name: str
    message: str
    arguments: Sequence[str] = ()
    prepare: Callable[[Path], Any] = lambda folder: None


def image(name: str, pixels: Any, **options: Any) -> Callable[[Path], None]:
    def prepare(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        Image.fromarray(np.asarray(pixels)).save(folder / name, **options)

    return prepare


def content(name: str, data: bytes | str) -> Callable[[Path], None]:
    def prepare(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)

    return prepare


def shortened(name: str) -> Callable[[Path], None]:
    return lambda folder: content(name, (folder / name).read_bytes()[:2000])(folder)


def folder_called(name: str) -> Callable[[Path], None]:
    def prepare(folder: Path) -> None:
        (folder / name).unlink(missing_ok=True)
        (folder / name).mkdir()

    return prepare


def calibration(**changes: Any) -> Callable[[Path], None]:
    """The example's calibration with other values; None leaves a key out."""

    def prepare(folder: Path) -> None:
        values = dict(Fields.read(folder / "rig.yaml").values) | changes
        kept = {key: value for key, value in values.items() if value is not None}
        content("rig.yaml", yaml.safe_dump(kept))(folder)

    return prepare


def own_calibration(**changes: Any) -> Callable[[Path], None]:
    """One in our own form; changes are of the right camera."""
    K = [[700.0, 0, 479.5], [0, 700, 269.5], [0, 0, 1]]
    cameras = {}
    for name, x in (("left", 0.0), ("right", -0.08)):
        pose = np.eye(4)
        pose[0, 3] = x
        cameras[name] = {"width": WIDTH, "height": HEIGHT, "K": K, "camera_from_rig": pose.tolist()}
    cameras["right"] |= changes
    return content("rig.yaml", json.dumps(cameras))


def camera_infos(projection: Any) -> Callable[[Path], None]:
    """Two of ROS, the right one with a projection of its own."""

    def prepare(folder: Path) -> None:
        for name, P in (("l", [700, 0, 480, 0, 0, 700, 270, 0, 0, 0, 1, 0]), ("r", projection)):
            info = {"width": WIDTH, "height": HEIGHT, "distortion_model": "plumb_bob", "D": [0.0] * 5}
            info |= {"K": [700, 0, 480, 0, 700, 270, 0, 0, 1], "R": np.eye(3).ravel().tolist(), "P": P}
            content(f"{name}.yaml", yaml.safe_dump(info))(folder)

    return prepare


def vast_png() -> bytes:
    """A valid PNG file of 30,000 x 30,000 white pixels in a hundred kB."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")

    side = 30_000
    head = side.to_bytes(4, "big") * 2 + bytes([1, 0, 0, 0, 0])
    rows = zlib.compress(bytes(side * (side // 8 + 1)))
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


def noise(*shape: int) -> Any:
    return np.random.default_rng(0).integers(256, size=shape, dtype=np.uint8)


UNREADABLE = np.tile(np.float32([[np.nan, np.inf, -np.inf, 0.5]]), (HEIGHT, WIDTH // 4))
PLAIN = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
TRANSPARENT = np.zeros((HEIGHT, WIDTH, 4), np.uint8)
BOXES = ["left_box=[410,200,620,380]", "right_box=[300,200,505,380]"]
ROS = ["rig=[l.yaml,r.yaml]"]
P_RIGHT = [700, 0, 480, -56, 0, 700, 270, 0, 0, 0, 1, 0]
LAUGHS = "a0: &a0 [1,1,1,1,1,1,1,1,1,1]\n" + "".join(
    f"a{i}: &a{i} [{','.join([f'*a{i - 1}'] * 10)}]\n" for i in range(1, 10)
)
OPENCV = "K1: 1\nD1: 1\nK2: 1\nD2: 1\nT: 1\n"

IMAGES = [
    Case("a missing image", r"left=none\.png: no such file", ["left=none.png"]),
    Case("a folder for an image", r"left=left\.png: no such file", prepare=folder_called("left.png")),
    Case("text for an image", r"left=left\.png: is no image; give PNG", prepare=content("left.png", "text")),
    Case("an empty image file", r"right=right\.png: is no image; give PNG", prepare=content("right.png", "")),
    Case("an image of nothing finite", r"left: ", prepare=image("left.tif", UNREADABLE), arguments=["left=left.tif"]),
    Case("half an image", r"left=left\.png: cannot be read \(", prepare=shortened("left.png")),
    Case("a vast image", r"left=left\.png: has more than 150 million pixels; scale it down",
         prepare=content("left.png", vast_png())),
    Case("one pixel", r"rig: the left camera was calibrated with 960 x 540 pixels, its image has 1 x 1",
         prepare=image("left.png", noise(1, 1, 3))),
    Case("one pixel and no size", r"left, right: have 1 x 1 and 960 x 540 pixels; they must",
         prepare=lambda folder: (image("left.png", noise(1, 1, 3))(folder), calibration(image_width=None)(folder))),
    Case("two single pixels", r"the principal point of the left camera is at \(480, 270\), but its image has 1 x 1",
         prepare=lambda folder: [image(f"{side}.png", noise(1, 1, 3))(folder) for side in ("left", "right")]
         and calibration(image_width=None)(folder)),
    Case("another shape than the calibration's", r"rig: the left camera .*960 x 540.*not the same shape",
         prepare=image("left.png", noise(480, 640, 3))),
    Case("different sizes without a size in the calibration", r"left, right: have 480 x 270 and 960 x 540 pixels",
         prepare=lambda folder: (image("left.png", PLAIN[::2, ::2])(folder), calibration(image_width=None)(folder))),
    Case("nothing in the image", r"left: what differs from its background covers 0 %.*give left_box=",
         prepare=image("left.png", PLAIN)),
    Case("a background that is not plain", r"right: its background is not plain.*give right_box=",
         prepare=image("right.png", noise(HEIGHT, WIDTH, 3))),
    Case("transparent everywhere", r"left: the image is transparent everywhere",
         prepare=image("left.png", TRANSPARENT)),
    Case("left and right swapped", r"left and right .*swapped", ["left=right.png", "right=left.png"]),
    Case("the same image twice", r"boxes: their rays are parallel.*check left and right", ["right=left.png"]),
    Case("a missing mask", r"left_mask=none\.png: no such file", ["left_mask=none.png"]),
    Case("a mask of another size", r"left_mask=mask\.png: has 20 x 10 pixels, its image 960 x 540",
         ["left_mask=mask.png"], image("mask.png", noise(10, 20))),
    Case("a black mask", r"left_mask=mask\.png: is empty; the object must be white on black",
         ["left_mask=mask.png"], image("mask.png", np.zeros((HEIGHT, WIDTH), np.uint8))),
    Case("a white mask", r"left_mask=mask\.png: covers the whole image",
         ["left_mask=mask.png"], image("mask.png", PLAIN)),
    Case("one box, around nothing", r"left: nothing in it looks like the object in the right image.*give left_box=",
         ["right_box=[10,10,60,60]"]),
    Case("three numbers for a box", r"left_box=\[1.0, 2.0, 3.0\]: must be \[left,top,right,bottom\]",
         ["left_box=[1,2,3]", BOXES[1]]),
    Case("a box inside out", r"left_box=.*: must have left < right", ["left_box=[620,200,410,380]", BOXES[1]]),
    Case("a box out of the image", r"right_box=.*reaches out of the image of 960 x 540",
         [BOXES[0], "right_box=[300,200,505,580]"]),
    Case("NaN in a box", r"left_box=.*: must have left < right", ["left_box=[nan,200,410,380]", BOXES[1]]),
    Case("infinity in a box", r"left_box=.*: reaches out of", ["left_box=[-inf,200,410,380]", BOXES[1]]),
    Case("words in a box", r"left_box=\[a,b,c,d\]: must be a list in brackets|must be numbers",
         ["left_box=[a,b,c,d]", BOXES[1]]),
    Case("boxes of different things", r"boxes: their rays meet behind the cameras",
         ["left_box=[10,200,60,380]", "right_box=[700,200,750,380]"]),
]  # fmt: skip

CALIBRATIONS = [
    Case("a missing calibration", r"rig=none\.yaml: no such file", ["rig=none.yaml"]),
    Case("a folder for a calibration", r"rig=rig\.yaml: no such file", prepare=folder_called("rig.yaml")),
    Case("broken YAML", r"rig=rig\.yaml: is neither YAML nor JSON, line 1",
         prepare=content("rig.yaml", "a: [1, 2")),
    Case("an empty calibration", r"rig=rig\.yaml: holds no keys", prepare=content("rig.yaml", "")),
    Case("a list", r"rig=rig\.yaml: holds no keys", prepare=content("rig.yaml", "[1, 2]")),
    Case("binary for a calibration", r"rig=rig\.yaml: cannot be read \(not text\)",
         prepare=content("rig.yaml", b"\x89PNG\xff")),
    Case("a vast calibration", r"rig=rig\.yaml: has 2\.0 MB.*calibration",
         prepare=content("rig.yaml", "a: 1\n" * 400_000)),
    Case("deep nesting", r"rig=rig\.yaml: is neither YAML nor JSON", prepare=content("rig.yaml", "[" * 50_000)),
    Case("references upon references", r"rig=rig\.yaml: R must be 3 x 3 numbers",
         prepare=content("rig.yaml", LAUGHS + OPENCV + "R: *a9")),
    Case("a reference to itself", r"rig=rig\.yaml: R must be 3 x 3 numbers",
         prepare=content("rig.yaml", OPENCV + "R: &r [*r]")),
    Case("a tag that names code", r"rig=rig\.yaml: is neither YAML nor JSON, line 1",
         prepare=content("rig.yaml", "x: !!python/object/apply:os.mkdir [it_ran]")),
    Case("unknown keys", r"is no known calibration; expected K1, .* found fx, fy",
         prepare=content("rig.yaml", "fx: 1\nfy: 1")),
    Case("no K2", r"rig=rig\.yaml: has no key K2 or M2", prepare=calibration(K2=None)),
    Case("no R", r"rig=rig\.yaml: has no key R", prepare=calibration(R=None)),
    Case("a short R", r"rig=rig\.yaml: R must be 3 x 3 numbers, got \[1, 2\]", prepare=calibration(R=[1, 2])),
    Case("R too large", r"rig: R and T of the right camera.* must be a rotation",
         prepare=calibration(R=(1.1 * np.eye(3)).tolist())),
    Case("a mirror for R", r"must be a rotation", prepare=calibration(R=np.diag([1.0, 1, -1]).tolist())),
    Case("NaN in R", r"rig: R and T of the right camera: must be a finite",
         prepare=calibration(R=np.full((3, 3), np.nan).tolist())),
    Case("a right camera that looks back", r"rig: the cameras look .* apart",
         prepare=calibration(R=np.diag([-1.0, 1, -1]).tolist())),
    Case("infinity in T", r"rig: R and T of the right camera: must be a finite",
         prepare=calibration(T=[-np.inf, 0, 0])),
    Case("T of zeros", r"rig: the cameras are 0 m apart", prepare=calibration(T=[0, 0, 0])),
    Case("T in millimetres", r"80 m apart, expected 0\.005 to 3\.0 m; are its lengths in mm\? set unit=mm",
         prepare=calibration(T=[-80, 0, 0])),
    Case("metres said to be millimetres", r"rig: the cameras are 8e-05 m apart.*set unit=", ["unit=mm"]),
    Case("an unknown unit", r"unit=feet: must be one of m, cm, mm, in", ["unit=feet"]),
    Case("NaN for a unit", r"unit=nan: must be one of m, cm, mm, in", ["unit=nan"]),
    Case("a negative baseline", r"rig: the left camera is right of the right one.*swap left and right",
         prepare=calibration(T=[0.08, 0, 0])),
    Case("one camera above the other", r"rig: the cameras must be side by side",
         prepare=calibration(T=[0, -0.08, 0])),
    Case("one camera behind the other", r"rig: the cameras must be side by side",
         prepare=calibration(T=[0, 0, -0.08])),
    Case("K of zeros", r"rig: K of the left camera must be .*positive focal lengths",
         prepare=calibration(K1=np.zeros((3, 3)).tolist())),
    Case("a negative focal length", r"rig: K of the right camera must be",
         prepare=calibration(K2=[[-700, 0, 480], [0, 700, 270], [0, 0, 1]])),
    Case("a focal length of a pixel", r"rig: the left camera has a focal length of 1 pixels.*check K",
         prepare=calibration(K1=[[1, 0, 480], [0, 1, 270], [0, 0, 1]])),
    Case("a vast focal length", r"rig: the right camera has a focal length of 1e\+08 pixels.*check K",
         prepare=calibration(K2=[[1e8, 0, 480], [0, 1e8, 270], [0, 0, 1]])),
    Case("numbers beyond counting in K", r"rig=rig\.yaml: K2 holds numbers above 1e\+09, got \[\[1e\+308",
         prepare=calibration(K2=[[1e308, 0, 480], [0, 1e308, 270], [0, 0, 1]])),
    Case("numbers beyond counting in T", r"rig=rig\.yaml: T holds numbers above 1e\+09",
         prepare=calibration(T=[-1e308, 0, 0])),
    Case("a vast unit", r"unit=1e\+300: must be one of m, cm, mm, in", ["unit=1e+300"]),
    Case("a word for fisheye", r"rig=rig\.yaml: fisheye must be true or false, got 'yes'",
         prepare=calibration(fisheye="yes")),
    Case("NaN in K", r"rig: K of the left camera must be",
         prepare=calibration(K1=[[np.nan, 0, 480], [0, 700, 270], [0, 0, 1]])),
    Case("K transposed", r"rig: K of the left camera must be .*transposed",
         prepare=calibration(K1=[[700, 0, 0], [0, 700, 0], [480, 270, 1]])),
    Case("three coefficients of distortion", r"distortion: plumb_bob takes .* got 3",
         prepare=calibration(D1=[0.1, 0.2, 0.3])),
    Case("NaN in the distortion", r"distortion: must be finite", prepare=calibration(D1=[np.nan] * 5)),
    Case("a word for the distortion", r"D1 must be numbers, got 'none'", prepare=calibration(D1="none")),
    Case("a distortion that folds the image", r"distortion: cannot be removed",
         prepare=calibration(D1=[-50.0, 0, 0, 0, 0], D2=[-50.0, 0, 0, 0, 0])),
    Case("a width of zero", r"image size must be .* got 0 x 540", prepare=calibration(image_width=0)),
    Case("an infinite width", r"image size must be .* got inf x 540", prepare=calibration(image_width=np.inf)),
    Case("a principal point far outside", r"principal point of the left camera",
         prepare=calibration(K1=[[700, 0, 47950], [0, 700, 26950], [0, 0, 1]])),
    Case("rectified without P1", r"rig=rig\.yaml: has no key P1", ["rectified=true"]),
    Case("a projection of zeros", r"rig: the projection of the right camera must be .*, got",
         ["rectified=true"],
         calibration(P1=[[700, 0, 480, 0], [0, 700, 270, 0], [0, 0, 1, 0]], P2=np.zeros((3, 4)).tolist())),
    Case("one camera_info", r"is of one camera; give both, left first", ["rig=l.yaml"], camera_infos(P_RIGHT)),
    Case("camera_info of no pair", r"rig: the cameras are 0 m apart",
         ROS, camera_infos([700, 0, 480, 0, 0, 700, 270, 0, 0, 0, 1, 0])),
    Case("camera_info of zeros", r"rig=r\.yaml: .*projection_matrix.*", ROS, camera_infos([0.0] * 12)),
    Case("camera_info, right first", r"rig: the left camera is right of the right one",
         ["rig=[r.yaml,l.yaml]"], camera_infos(P_RIGHT)),
    Case("a pose that is no matrix", r"camera_from_rig must be 4 x 4 numbers",
         prepare=own_calibration(camera_from_rig=[1, 2])),
    Case("a pose that is no motion", r"rig: R and T of the right camera.*must be a rotation",
         prepare=own_calibration(camera_from_rig=np.diag([2.0, 2, 2, 1]).tolist())),
    Case("a pose of zeros", r"must be a rotation",
         prepare=own_calibration(camera_from_rig=np.diag([0.0, 0, 0, 1]).tolist())),
    Case("an unknown lens", r"model must be plumb_bob or fisheye, got sausage",
         prepare=own_calibration(model="sausage")),
    Case("a camera without keys", r"right must hold keys of its own, got 3",
         prepare=content("rig.yaml", "left: {K: 1}\nright: 3")),
]  # fmt: skip

SETTINGS = [
    Case("no arguments", r"left: no value given; add left=\.\.\.", ["left=???"]),
    Case("a misspelt key", r"lefft: unknown key; did you mean left", ["lefft=left.png"]),
    Case("a format that cannot be written", r"output=mug\.xyz: must end in one of \.glb", ["output=mug.xyz"]),
    Case("an output that is a folder", r"output=mug\.ply: is a folder", prepare=folder_called("mug.ply")),
    Case("a description that is a folder", r"output=mug\.ply: would write mug\.json, which is a folder",
         prepare=folder_called("mug.json")),
    Case("an output over the calibration", r"output=rig\.ply: would write over rig=rig\.json; give another file",
         ["output=rig.ply", "rig=rig.json"], lambda folder: (folder / "rig.yaml").rename(folder / "rig.json")),
    Case("a preview over a photograph", r"output=a\.ply: would write over left=a_preview\.png",
         ["output=a.ply", "left=a_preview.png", "preview=true"],
         lambda folder: (folder / "left.png").rename(folder / "a_preview.png")),
    Case("an output below a file", r"output=.*cannot be written \((Not a directory|File exists)\)",
         ["output=rig.yaml/mug.ply"]),
    Case("a name too long to write", r"output=.*cannot be written \(File name too long\)",
         [f"output={'n' * 250}.ply"]),
    Case("a name too long to read", r"File name too long", [f"left={'n' * 300}.png"]),
    Case("NaN for the threshold", r"threshold=nan: must be a probability", ["threshold=nan"]),
    Case("a threshold that nothing reaches", r"nothing is occupied at a probability of 1; .*lower threshold=",
         ["threshold=0.99999999"]),
    Case("a resolution beyond memory", r"resolution=100000: must be 8 to 512 cells", ["resolution=100000"]),
    Case("an infinite simplification", r"simplify=inf: must be metres above 0", ["simplify=inf"]),
    Case("a centre behind the cameras", r"must be in front of the cameras", ["center=[0,0,-1]", "size=0.1"]),
    Case("a centre beside the images", r"center=\[1000000\.0, 0\.0, 1\.0\]: is at pixel \(\d+, \d+\) of an image of",
         ["center=[1e6,0,1]", "size=0.1"]),
    Case("a centre too far away", r"center=\[.*1e\+06 m away; it must be in both images and at most 100 m away",
         ["center=[0,0,1e6]", "size=0.1"]),
    Case("a centre of two numbers", r"center=\[0\.0, 0\.0\]: must be \[x,y,z\]", ["center=[0,0]", "size=0.1"]),
    Case("NaN for the centre", r"center=\[nan, 0\.0, 1\.0\]: must be \[x,y,z\]",
         ["center=[nan,0,1]", "size=0.1"]),
    Case("a size of NaN", r"size=nan: must be metres above 0", ["size=nan"]),
    Case("a negative size", r"size=-0\.1: must be metres above 0", ["size=-0.1"]),
    Case("an unknown frame", r"frame=world: must be one of left, rig", ["frame=world"]),
    Case("threads beyond counting", r"threads=100000: must be at most \d+, 16 for each core; this machine has \d",
         ["threads=100000"]),
    Case("threads below one", r"threads=0: must be at least 1", ["threads=0"]),
]  # fmt: skip
