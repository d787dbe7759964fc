"""The one pass: colour, metric depth and label of a pixel come from one fragment."""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from unilavira_drake.raster.culling import Pinhole
from unilavira_drake.raster.light import SUNS, Light

EXPOSURE = np.dtype(
    [
        ("clip_from_world", "<f4", (4, 4)),
        ("light_from_below", "<f4", 4),
        ("light_from_above", "<f4", 4),
        ("suns", "<f4", (SUNS, 4)),
        ("depth_range", "<f4", 4),
    ]
)
"""The block that all programs read, as OpenGL's layout std140 has it: matrices by column, vectors
of four."""

_EXPOSURE = """
layout(std140) uniform Exposure {
    mat4 clip_from_world;
    vec4 light_from_below;  // On a face that looks along -x, -y, -z.
    vec4 light_from_above;  // On a face that looks along +x, +y, +z.
    vec4 suns[3];
    vec4 depth_range;  // Least and greatest, and what stands for more.
};
"""

VERTEX_SHADER = """
in vec3 position;
in vec4 row_x;
in vec4 row_y;
in vec4 row_z;
invariant gl_Position;
#ifdef TEXTURED
in vec2 uv;
out vec2 picture;
#endif
#ifdef COLORED
in vec4 normal;
in vec4 color;
in vec4 tint;
in int label;
out vec3 shaded;
flat out int name;
#endif

void main() {
    vec4 p = vec4(position, 1.0);
    gl_Position = clip_from_world * vec4(dot(row_x, p), dot(row_y, p), dot(row_z, p), 1.0);
#ifdef TEXTURED
    picture = uv;
#endif
#ifdef COLORED
    vec3 m = normal.xyz * (255.0 / 127.0) - 128.0 / 127.0;
    vec3 n = vec3(dot(row_x.xyz, m), dot(row_y.xyz, m), dot(row_z.xyz, m));
    vec3 side = mix(light_from_below.xyz, light_from_above.xyz, step(0.0, n));
    float sun = 0.0;
    for (int i = 0; i < 3; i++) sun += max(0.0, dot(n, suns[i].xyz));
    float light = 0.5 * (dot(n * n, side) + min(sun, 1.0));
    shaded = color.rgb * tint.rgb * (normal.w * pow(light, tint.a));
    name = label;
#endif
}
"""

FRAGMENT_SHADER = """
#ifdef TEXTURED
in vec2 picture;
uniform sampler2D image;
#endif
#ifdef MASKED
uniform float cutoff;
#endif
#ifdef COLORED
in vec3 shaded;
flat in int name;
layout(location = 0) out vec4 out_color;
layout(location = 1) out float out_depth;
layout(location = 2) out vec2 out_label;  // Low and high byte.
#else
layout(location = 0) out float out_depth;
#endif

void main() {
#ifdef TEXTURED
    vec4 texel = texture(image, picture);
#endif
#ifdef MASKED
    if (texel.a < cutoff) discard;
#endif
#ifdef COLORED
#ifdef TEXTURED
    out_color = vec4(shaded * texel.rgb, 1.0);
#else
    out_color = vec4(shaded, 1.0);
#endif
    out_label = vec2(name & 255, name >> 8) / 255.0;
#endif
    float z = 1.0 / gl_FragCoord.w;
    out_depth = z < depth_range.x ? 0.0 : z > depth_range.y ? depth_range.z : z;
}
"""


def source(body: str, *defines: str) -> str:
    """Returns a shader with its version and what is defined for it."""
    return "\n".join(
        ["#version 330 core", *(f"#define {name}" for name in defines), _EXPOSURE, body]
    )


def exposure_block(clip: NDArray[np.float64], pinhole: Pinhole, light: Light) -> NDArray[np.uint8]:
    """Returns the bytes of the block.

    Args:
        clip: (4, 4) from the world to clip coordinates.
        pinhole: for its range of depth.
        light: on all surfaces.
    """
    block = np.zeros((), EXPOSURE)
    block["clip_from_world"] = clip.T
    block["light_from_below"], block["light_from_above"], block["suns"] = _lit(light)
    block["depth_range"][:3] = pinhole.min_depth, pinhole.max_depth, np.inf
    return block.reshape(1).view(np.uint8)


@functools.lru_cache(maxsize=16)
def _lit(light: Light) -> tuple[NDArray[np.float64], ...]:
    """Returns the light on faces that look down and up the axes, and the suns; each (..., 4)."""
    below, above = (np.array((*light.sides(sign), 0.0)) for sign in (-1.0, 1.0))
    return below, above, np.pad(light.padded(), ((0, 0), (0, 1)))
