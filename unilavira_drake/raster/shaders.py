"""The one pass: colour, metric depth and label of a pixel come from one fragment."""

from __future__ import annotations

VERTEX_SHADER = """
in vec3 position;
in vec4 row_x;
in vec4 row_y;
in vec4 row_z;
uniform mat4 clip_from_world;
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
uniform vec3 light_from_below;  // On a face that looks along -x, -y, -z.
uniform vec3 light_from_above;  // On a face that looks along +x, +y, +z.
uniform vec3 suns[3];
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
    vec3 side = mix(light_from_below, light_from_above, step(0.0, n));
    float sun = max(0.0, dot(n, suns[0])) + max(0.0, dot(n, suns[1])) + max(0.0, dot(n, suns[2]));
    float light = 0.5 * (dot(n * n, side) + min(sun, 1.0));
    shaded = color.rgb * tint.rgb * (normal.w * pow(light, tint.a));
    name = label;
#endif
}
"""

FRAGMENT_SHADER = """
uniform vec2 depth_range;
uniform float infinity;
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
    out_depth = z < depth_range.x ? 0.0 : z > depth_range.y ? infinity : z;
}
"""


def source(body: str, *defines: str) -> str:
    """Returns a shader with its version and what is defined for it."""
    return "\n".join(["#version 330 core", *(f"#define {name}" for name in defines), body])
