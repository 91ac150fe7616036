"""Memory on the GPU: triangles that are drawn, and what is drawn into."""

import numpy as np
from numpy.typing import NDArray

from stereo_occ.render.gl import import_pyrender
from stereo_occ.render.vertices import ATTRIBUTES

import_pyrender()

from OpenGL import GL  # noqa: E402 (the platform is chosen above)

#: What the first pass stores for the second, each in a texture of its own.
STORED = ("position", "normal", "pattern", "open")


class VertexArray:
    """Indexed triangles on the GPU; filled again and again."""

    def __init__(self) -> None:
        self.count = 0
        self._array = GL.glGenVertexArrays(1)
        self._vertices, self._indices = GL.glGenBuffers(2)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._vertices)
        GL.glBindBuffer(GL.GL_ELEMENT_ARRAY_BUFFER, self._indices)
        stride, offset = 4 * sum(ATTRIBUTES), 0
        for location, components in enumerate(ATTRIBUTES):
            GL.glEnableVertexAttribArray(location)
            pointer = GL.ctypes.c_void_p(4 * offset)
            GL.glVertexAttribPointer(location, components, GL.GL_FLOAT, GL.GL_FALSE, stride, pointer)
            offset += components
        GL.glBindVertexArray(0)

    def fill(self, vertices_V15: NDArray[np.float32], faces_F3: NDArray[np.integer]) -> None:
        """Put these there in place of what was."""
        self.count = 3 * len(faces_F3)
        GL.glBindVertexArray(self._array)
        GL.glBindBuffer(GL.GL_ARRAY_BUFFER, self._vertices)
        GL.glBufferData(GL.GL_ARRAY_BUFFER, np.ascontiguousarray(vertices_V15), GL.GL_DYNAMIC_DRAW)
        indices = np.ascontiguousarray(faces_F3, np.uint32)
        GL.glBufferData(GL.GL_ELEMENT_ARRAY_BUFFER, indices, GL.GL_DYNAMIC_DRAW)
        GL.glBindVertexArray(0)

    def draw(self) -> None:
        """All of them, with the program in use."""
        GL.glBindVertexArray(self._array)
        GL.glDrawElements(GL.GL_TRIANGLES, self.count, GL.GL_UNSIGNED_INT, None)
        GL.glBindVertexArray(0)


class Targets:
    """Framebuffers of one size: what the first pass stores, and the picture."""

    def __init__(self, width: int, height: int) -> None:
        self._size = width, height
        self._textures = [int(name) for name in GL.glGenTextures(len(STORED) + 2)]
        self._depth = GL.glGenRenderbuffers(1)
        GL.glBindRenderbuffer(GL.GL_RENDERBUFFER, self._depth)
        GL.glRenderbufferStorage(GL.GL_RENDERBUFFER, GL.GL_DEPTH_COMPONENT24, width, height)
        four, one = (GL.GL_RGBA32F, GL.GL_RGBA), (GL.GL_R32F, GL.GL_RED)
        formats = [four, four, four, one, (GL.GL_RGBA8, GL.GL_RGBA), one]
        for texture, (stored, given) in zip(self._textures, formats, strict=True):
            GL.glBindTexture(GL.GL_TEXTURE_2D, texture)
            GL.glTexImage2D(GL.GL_TEXTURE_2D, 0, stored, width, height, 0, given, GL.GL_FLOAT, None)
            for filtering in (GL.GL_TEXTURE_MIN_FILTER, GL.GL_TEXTURE_MAG_FILTER):
                GL.glTexParameteri(GL.GL_TEXTURE_2D, filtering, GL.GL_NEAREST)
        self.textures, pictures = self._textures[: len(STORED)], self._textures[len(STORED) :]
        self.store, self.light = self._framebuffer(self.textures), self._framebuffer(pictures)

    def _framebuffer(self, textures: list[int]) -> int:
        framebuffer = int(GL.glGenFramebuffers(1))
        GL.glBindFramebuffer(GL.GL_FRAMEBUFFER, framebuffer)
        places = [GL.GL_COLOR_ATTACHMENT0 + index for index in range(len(textures))]
        for place, texture in zip(places, textures, strict=True):
            GL.glFramebufferTexture2D(GL.GL_FRAMEBUFFER, place, GL.GL_TEXTURE_2D, texture, 0)
        GL.glFramebufferRenderbuffer(
            GL.GL_FRAMEBUFFER, GL.GL_DEPTH_ATTACHMENT, GL.GL_RENDERBUFFER, self._depth
        )
        GL.glDrawBuffers(len(places), places)
        return framebuffer

    def read(self) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Colour and depth, top row first."""
        width, height = self._size
        GL.glBindFramebuffer(GL.GL_READ_FRAMEBUFFER, self.light)
        rgba_HW4, depth_HW = np.empty((height, width, 4), np.uint8), np.empty((height, width), np.float32)
        GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT0)
        GL.glReadPixels(0, 0, width, height, GL.GL_RGBA, GL.GL_UNSIGNED_BYTE, rgba_HW4)
        GL.glReadBuffer(GL.GL_COLOR_ATTACHMENT1)
        GL.glReadPixels(0, 0, width, height, GL.GL_RED, GL.GL_FLOAT, depth_HW)
        return rgba_HW4[::-1], depth_HW[::-1]

    def delete(self) -> None:
        """Give the memory back."""
        GL.glDeleteFramebuffers(2, [self.store, self.light])
        GL.glDeleteTextures(self._textures)
        GL.glDeleteRenderbuffers(1, [self._depth])
