"""Shadows that lights cast on and around the object: a depth map for each light (Williams, SIGGRAPH 1978)."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from stereo_occ.render.gl import import_pyrender

import_pyrender()

from OpenGL import GL  # noqa: E402 (the platform is chosen above)

#: Texels along each side of a map.
SIDE = 512

#: Half of what a map covers across the light and along it, diagonals of the object; beyond, nothing is in shadow.
ACROSS, ALONG = 1.0, 8.0


class ShadowMaps:
    """Depth maps of up to ``layers`` directional lights, about one place.

    Only the sides of things that face away from the light are drawn into them, so that no lit surface is taken to
    shade itself.
    """

    def __init__(self, layers: int) -> None:
        self.texture = GL.glGenTextures(1)
        GL.glBindTexture(GL.GL_TEXTURE_2D_ARRAY, self.texture)
        GL.glTexImage3D(
            GL.GL_TEXTURE_2D_ARRAY, 0, GL.GL_DEPTH_COMPONENT24, SIDE, SIDE, layers, 0,
            GL.GL_DEPTH_COMPONENT, GL.GL_FLOAT, None,
        )  # fmt: skip
        for name, value in (
            (GL.GL_TEXTURE_MIN_FILTER, GL.GL_LINEAR),
            (GL.GL_TEXTURE_MAG_FILTER, GL.GL_LINEAR),
            (GL.GL_TEXTURE_WRAP_S, GL.GL_CLAMP_TO_EDGE),
            (GL.GL_TEXTURE_WRAP_T, GL.GL_CLAMP_TO_EDGE),
            (GL.GL_TEXTURE_COMPARE_MODE, GL.GL_COMPARE_REF_TO_TEXTURE),
            (GL.GL_TEXTURE_COMPARE_FUNC, GL.GL_LEQUAL),
        ):
            GL.glTexParameteri(GL.GL_TEXTURE_2D_ARRAY, name, value)
        self._framebuffer = GL.glGenFramebuffers(1)

    def draw(
        self,
        from_L3: NDArray[np.float64],
        middle_3: NDArray[np.float64],
        diagonal: float,
        draw: Callable[[NDArray[np.float64]], None],
    ) -> NDArray[np.float64]:
        """Fill the maps of lights; ``(L, 4, 4)`` places of rig-frame points in them, 0 to 1 along each axis.

        Args:
            from_L3: unit vectors towards the lights, rig frame.
            middle_3, diagonal: of the object, rig frame.
            draw: draws what casts shadows, given ``clip_from_rig``.
        """
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, self._framebuffer)
        GL.glViewport(0, 0, SIDE, SIDE)
        GL.glDrawBuffer(GL.GL_NONE)
        GL.glEnable(GL.GL_DEPTH_TEST)
        GL.glEnable(GL.GL_DEPTH_CLAMP)
        GL.glDepthMask(GL.GL_TRUE)
        GL.glDepthFunc(GL.GL_LESS)
        GL.glEnable(GL.GL_CULL_FACE)
        GL.glCullFace(GL.GL_FRONT)
        maps_L44 = np.stack([_clip_from_rig(from_3, middle_3, diagonal) for from_3 in from_L3])
        for layer, clip_from_rig in enumerate(maps_L44):
            GL.glFramebufferTextureLayer(GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, self.texture, 0, layer)
            GL.glClear(GL.GL_DEPTH_BUFFER_BIT)
            draw(clip_from_rig)
        GL.glDisable(GL.GL_DEPTH_CLAMP)
        return _HALVED @ maps_L44


#: From OpenGL's clip space, -1 to 1, to textures.
_HALVED = np.array([[0.5, 0, 0, 0.5], [0, 0.5, 0, 0.5], [0, 0, 0.5, 0.5], [0, 0, 0, 1]])


def _clip_from_rig(
    from_3: NDArray[np.float64], middle_3: NDArray[np.float64], diagonal: float
) -> NDArray[np.float64]:
    """Orthographic, along the light; what is farther along it is deeper."""
    right_3 = np.cross(np.eye(3)[np.abs(from_3).argmin()], from_3)
    right_3 /= np.linalg.norm(right_3)
    axes_33 = np.stack([right_3, np.cross(from_3, right_3), -from_3])
    scaled_33 = axes_33 / (diagonal * np.array([ACROSS, ACROSS, ALONG]))[:, None]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = scaled_33, -scaled_33 @ middle_3
    return matrix
