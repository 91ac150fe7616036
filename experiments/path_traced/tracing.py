"""Scenes as Mitsuba 3 renders them: linear light by path tracing, and which pixels show the object."""

from functools import partial
from typing import Any

import drjit
import mitsuba
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation
from trimesh import Trimesh

mitsuba.set_variant("llvm_ad_rgb")
drjit.set_thread_count(1)

from experiments.path_traced.cleaning import cleaned  # noqa: E402
from experiments.path_traced.room import Light  # noqa: E402
from experiments.path_traced.scenes import Scene  # noqa: E402
from experiments.path_traced.surfaces import Surface  # noqa: E402
from experiments.path_traced.things import Thing  # noqa: E402
from stereo_occ.geometry.camera import Camera, transform_points  # noqa: E402
from stereo_occ.geometry.crop import Box  # noqa: E402
from stereo_occ.render.finish import root_of_linear  # noqa: E402
from stereo_occ.render.normals import split_at_creases  # noqa: E402
from stereo_occ.render.stereo import CREASE_ANGLE  # noqa: E402

#: Mitsuba's cameras look along +Z with +X left and +Y up.
CV_FROM_MITSUBA = np.diag([-1.0, -1.0, 1.0, 1.0])

#: Samples per pixel of the whole image, which is cleaned, and of the object, which is not.
SAMPLES, CLOSE_SAMPLES = 4, 64

#: Side of the part that is sampled so well over that of the object's box.
CLOSE = 1.1

#: Samples per pixel of albedo, normals and depth.
GUIDE_SAMPLES = 4

#: Light, along paths that meet at most so many surfaces.
PATHS = {"type": "path", "max_depth": 6, "rr_depth": 3}

#: Albedo, normal and depth.
SURFACES = {"type": "aov", "aovs": "albedo:albedo,normal:sh_normal,depth:depth"}


def traced(scene: Scene, seed: int) -> tuple[NDArray[np.float32], NDArray[np.bool_], NDArray[np.bool_]]:
    """A pair ``(2, H, W, 3)`` in linear light, the object's masks and the lights' ``(2, H, W)``.

    Masks say what the ray through the middle of each pixel meets first.
    """
    loaded, target = _load(scene)
    lights, masks, emitters = [], [], []
    for index, camera in enumerate(scene.rig.cameras):
        stream = partial(_stream, seed, index)
        mask_HW, emitter_HW = _first_met(loaded, target, camera)
        guides = _render(loaded, SURFACES, camera, GUIDE_SAMPLES, stream(0), None)
        light_HW3 = _render(loaded, PATHS, camera, SAMPLES, stream(1), None)
        box = _close(Box.of_mask(mask_HW), camera)
        left, top, right, bottom = box
        close_HW3 = _render(loaded, PATHS, camera, CLOSE_SAMPLES, stream(2), box)
        light_HW3[top:bottom, left:right] = close_HW3
        around_HW3 = cleaned(light_HW3, guides[..., :3], guides[..., 3:6], guides[..., 6])
        lights.append(np.where(binary_dilation(mask_HW)[..., None], light_HW3, around_HW3))
        masks.append(mask_HW)
        emitters.append(emitter_HW)
    return np.stack(lights), np.stack(masks), np.stack(emitters)


def _stream(seed: int, camera: int, image: int) -> int:
    """Another seed for each image of a pair."""
    return (2 * seed + camera) * 3 + image


def _close(box: Box, camera: Camera) -> tuple[int, int, int, int]:
    """Left, top, right and bottom, in whole pixels of the image, of what is sampled well."""
    (u, v), width, height = box.center, box.right - box.left, box.bottom - box.top
    half_2 = CLOSE / 2 * np.array([width, height])
    low_2 = np.floor(np.array([u, v]) + 0.5 - half_2).clip(0)
    high_2 = np.ceil(np.array([u, v]) + 0.5 + half_2).clip(None, [camera.width, camera.height])
    return int(low_2[0]), int(low_2[1]), int(high_2[0]), int(high_2[1])


def _render(
    loaded: Any,
    integrator: dict[str, Any],
    camera: Camera,
    samples: int,
    seed: int,
    part: tuple[int, int, int, int] | None,
) -> NDArray[np.float32]:
    """What the integrator finds ``(H, W, C)`` in a part of the image, or in all of it."""
    left, top, right, bottom = part or (0, 0, camera.width, camera.height)
    film = {
        "type": "hdrfilm",
        "width": camera.width,
        "height": camera.height,
        "crop_offset_x": left,
        "crop_offset_y": top,
        "crop_width": right - left,
        "crop_height": bottom - top,
        "rfilter": {"type": "box"},
    }
    sampler = {"type": "multijitter", "sample_count": samples}
    sensor = mitsuba.load_dict(_sensor(camera) | {"film": film, "sampler": sampler})
    found = mitsuba.load_dict(integrator)
    return np.array(mitsuba.render(loaded, sensor=sensor, integrator=found, spp=samples, seed=seed))


def _sensor(camera: Camera) -> dict[str, Any]:
    world_from_camera = np.linalg.inv(camera.camera_from_rig) @ CV_FROM_MITSUBA
    return {
        "type": "perspective",
        "fov": float(np.degrees(2 * np.arctan(camera.width / 2 / camera.K[0, 0]))),
        "fov_axis": "x",
        "near_clip": 0.01,
        "to_world": mitsuba.ScalarTransform4f(world_from_camera),
    }


def _first_met(loaded: Any, target: Any, camera: Camera) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Where the object ``(H, W)`` and where a light is what a pixel shows."""
    v_HW, u_HW = np.mgrid[: camera.height, : camera.width]
    pixels_N2 = np.stack([u_HW.ravel(), v_HW.ravel()], axis=1).astype(np.float64)
    ahead_N3 = camera.unproject(pixels_N2, np.ones(len(pixels_N2))) - camera.center
    ahead_N3 /= np.linalg.norm(ahead_N3, axis=1, keepdims=True)
    ray = mitsuba.Ray3f(mitsuba.Point3f(camera.center), mitsuba.Vector3f(ahead_N3.T.astype(np.float32)))
    met = loaded.ray_intersect(ray)
    size = camera.height, camera.width
    return (
        np.array(met.shape == mitsuba.ShapePtr(target)).reshape(size),
        np.array(met.shape.is_emitter() & met.is_valid()).reshape(size),
    )


def _load(scene: Scene) -> tuple[Any, Any]:
    """Mitsuba's scene, and the object in it."""
    mesh = Trimesh(
        transform_points(np.asarray(scene.shape.mesh.vertices), scene.world_from_object),
        scene.shape.mesh.faces,
        process=False,
    )
    target = _mesh("target", Thing(mesh, scene.surface, scene.shape.colors))
    parts: dict[str, Any] = {"type": "scene", "target": target}
    for index, thing in enumerate(scene.things):
        parts[f"thing_{index}"] = _mesh(f"thing_{index}", thing)
    for index, light in enumerate(scene.lights):
        parts[f"light_{index}"] = _light(light)
    return mitsuba.load_dict(parts), target


def _light(light: Light) -> dict[str, Any]:
    return {
        "type": "sphere" if light.ball else "rectangle",
        "to_world": mitsuba.ScalarTransform4f(light.world_from_unit),
        "emitter": {"type": "area", "radiance": {"type": "rgb", "value": light.radiance_3.tolist()}},
    }


def _mesh(name: str, thing: Thing) -> Any:
    """A thing with smooth normals, creases kept, and its picture laid on from the nearest of six sides."""
    source_V, normals_V3, faces_F3 = split_at_creases(thing.mesh, CREASE_ANGLE)
    own_V3 = np.asarray(thing.mesh.vertices)[source_V]
    properties = mitsuba.Properties()
    properties["bsdf"] = mitsuba.load_dict(_material(thing.surface))
    mesh = mitsuba.Mesh(name, len(own_V3), len(faces_F3), properties, True, True)
    values = mitsuba.traverse(mesh)
    rotation_33 = np.eye(3) if thing.world_from_thing is None else thing.world_from_thing[:3, :3]
    values["vertex_positions"] = np.ravel(thing.world_V3[source_V]).astype(np.float32)
    values["vertex_normals"] = np.ravel(normals_V3 @ rotation_33.T).astype(np.float32)
    values["vertex_texcoords"] = np.ravel(_flat(own_V3, normals_V3)).astype(np.float32)
    values["faces"] = np.ravel(faces_F3).astype(np.uint32)
    if thing.surface.own and thing.colors_V3 is not None:
        linear_V3 = root_of_linear(thing.colors_V3[source_V]) ** 2
        mesh.add_attribute("vertex_color", 3, np.ravel(linear_V3).astype(np.float32))
    values.update()
    return mesh


def _flat(points_V3: NDArray[np.float64], normals_V3: NDArray[np.float64]) -> NDArray[np.float64]:
    """Texture coordinates ``(V, 2)``, metres: along the two axes that the surface faces least."""
    axis_V = np.abs(normals_V3).argmax(axis=1)
    kept_32 = np.array([[2, 1], [0, 2], [0, 1]])
    return np.take_along_axis(points_V3, kept_32[axis_V], axis=1)


def _material(surface: Surface) -> dict[str, Any]:
    color: dict[str, Any] = {"type": "rgb", "value": surface.color_3.tolist()}
    if surface.own:
        color = {"type": "mesh_attribute", "name": "vertex_color"}
    elif surface.picture_HW3 is not None:
        color = {
            "type": "bitmap",
            "bitmap": mitsuba.Bitmap(surface.picture_HW3.copy()),
            "wrap_mode": "mirror",
            "to_uv": mitsuba.ScalarTransform3f().scale(1 / surface.tile),
        }
    if surface.roughness == 1:
        return {"type": "diffuse", "reflectance": color}
    if surface.coated:
        return {
            "type": "roughplastic",
            "diffuse_reflectance": color,
            "alpha": surface.roughness**2,
            "nonlinear": True,
        }
    return {
        "type": "principled",
        "base_color": color,
        "roughness": surface.roughness,
        "metallic": surface.metallic,
    }
