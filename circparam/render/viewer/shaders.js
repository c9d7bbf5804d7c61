/* The shaders. One program fills faces, one draws seams as thick lines; both serve the surface and the
   plane, which differ by one matrix and by what is taken for the position. */

const COMMON = `#version 300 es
precision highp float;
precision highp int;
uniform mat4 matrix;      // from stored numbers (0..1) to the clip space of the panel
uniform bool plane;       // the layout instead of the surface
uniform int hovered;      // chart under the pointer, or -1
`;

const FILL_VERTEX = `${COMMON}
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 uv;
layout(location = 2) in vec2 normal;
layout(location = 3) in uint chart;
layout(location = 4) in uint distortion;
layout(location = 5) in uint copied; // shows another face again
uniform int mode;
uniform vec3 extent;
uniform vec4 uvBox;
uniform mat3 turn;
flat out uint chartId;
flat out uint distortionCode;
flat out uint densityCode;
out vec3 corner;          // barycentric: distance to the edges of the face, for the wireframe
out vec2 at;
out vec3 space;
out vec3 smoothNormal;
vec3 unfold(vec2 e) {     // octahedral: two numbers for a direction
  e = e * 2.0 - 1.0;
  vec3 n = vec3(e, 1.0 - abs(e.x) - abs(e.y));
  float t = max(-n.z, 0.0);
  n.xy += vec2(n.x >= 0.0 ? -t : t, n.y >= 0.0 ? -t : t);
  return normalize(n);
}
void main() {
  chartId = chart;
  distortionCode = distortion & 255u;
  densityCode = distortion >> 8;
  int k = gl_VertexID % 3;
  corner = vec3(k == 0, k == 1, k == 2);
  at = uvBox.xy + uv * uvBox.zw;
  smoothNormal = turn * unfold(normal);
  space = turn * (position * extent);
  gl_Position = matrix * (plane ? vec4(uv, 0.0, 1.0) : vec4(position, 1.0));
  bool counted = mode == 7 || mode == 8;
  if (plane && (chart == 0xffffffffu || (counted && copied != 0u))) gl_Position = vec4(2.0, 2.0, 2.0, 1.0);
}`;

const FILL_FRAGMENT = `${COMMON}
uniform int mode;         // as MODES of renderer.js
uniform vec4 uvBox;
uniform float cells;
uniform float distortionEnd; // log of the end of the scale
uniform vec3 palette[24];
uniform vec3 flipColour;
uniform vec3 emptyColour;
uniform vec3 faded;       // what charts fade to that are not pointed at
uniform bool insideOut;
uniform sampler2D ramp;
uniform sampler2D image;
uniform bool hasImage;
uniform bool wire;
uniform vec3 warnColour;
flat in uint chartId;
flat in uint distortionCode;
flat in uint densityCode;
in vec3 corner;
in vec2 at;
in vec3 space;
in vec3 smoothNormal;
out vec4 colour;
float checker(vec2 p) {   // the sign of two sines, softened over one pixel
  vec2 w = fwidth(p);
  vec2 s = clamp(sin(3.14159265 * p) / max(3.14159265 * w, 1e-6), -1.0, 1.0);
  float fade = clamp(1.6 - 2.0 * max(w.x, w.y), 0.0, 1.0);
  return 0.5 - 0.5 * s.x * s.y * fade;
}
vec3 base(out float shade) {
  shade = 1.0;
  if (chartId == 0xffffffffu) return emptyColour;
  vec3 own = palette[int(chartId % 24u)];
  if (mode == 1) {
    shade = 0.5;
    if (distortionCode == 255u) return flipColour;
    float s = float(distortionCode) / 254.0;
    return texture(ramp, vec2(clamp(s * s * 6.9077553 / distortionEnd, 0.0, 1.0) * 0.996 + 0.002, 0.5)).rgb;
  }
  if (mode == 2) return mix(own, vec3(1.0), plane ? 0.45 : 0.25);
  if (mode == 4) {        // blue: fewer texels than the mean, red: more
    float s = float(densityCode) / 127.5 - 1.0;
    shade = 0.5;
    return s < 0.0 ? mix(vec3(0.95), vec3(0.13, 0.40, 0.76), -s) : mix(vec3(0.95), vec3(0.80, 0.16, 0.16), s);
  }
  if (mode == 5) {        // image: how many faces cover a place of the layout
    if (distortionCode == 255u) return flipColour;
    bool twice = texture(image, (at - uvBox.xy) / uvBox.zw).r > 1.5 / 255.0;
    return !plane && twice && chartId != 0xffffffffu ? warnColour : mix(own, vec3(0.93), 0.8);
  }
  if (mode == 7) return warnColour;
  if (mode == 3) return hasImage ? texture(image, at).rgb : emptyColour;
  float c = checker(at * cells);
  return plane ? mix(mix(own, vec3(1.0), 0.62), mix(own, vec3(1.0), 0.42), c)
               : mix(mix(own, vec3(1.0), 0.80), mix(own, vec3(1.0), 0.18), c);
}
void main() {
  if (mode == 8) {
    colour = vec4(1.0 / 255.0);
    return;
  }
  if (mode == 6) {
    uint id = chartId + 1u;
    colour = vec4(float(id & 255u), float((id >> 8) & 255u), float((id >> 16) & 255u), 255.0) / 255.0;
    return;
  }
  float shade;
  vec3 c = base(shade);
  if (!plane) {
    vec3 flat_ = normalize(cross(dFdx(space), dFdy(space)));   // always towards the viewer
    bool back = gl_FrontFacing == insideOut;
    vec3 n = normalize(smoothNormal) * (back != insideOut ? -1.0 : 1.0);
    if (dot(n, flat_) < 0.766) n = flat_;
    float key = pow(clamp(0.5 + 0.5 * dot(n, normalize(vec3(-0.40, 0.55, 0.73))), 0.0, 1.0), 1.6);
    float light = 0.42 + 0.57 * key + 0.10 * (0.5 + 0.5 * n.y);
    if (back && mode != 3) c = mix(c, vec3(0.62, 0.63, 0.65), 0.45);
    c *= 1.0 - shade + shade * light;
  }
  if (wire) {
    vec3 w = corner / max(fwidth(corner), vec3(1e-6));
    c = mix(c, vec3(0.12, 0.14, 0.2), 0.55 * (1.0 - smoothstep(0.4, 1.3, min(w.x, min(w.y, w.z)))));
  }
  if (hovered >= 0 && int(chartId) != hovered) c = mix(c, faded, 0.72);
  colour = vec4(c, 1.0);
}`;

const LINE_VERTEX = `${COMMON}
layout(location = 0) in vec3 startPosition;
layout(location = 1) in vec3 stopPosition;
layout(location = 2) in vec2 startUv;
layout(location = 3) in vec2 stopUv;
layout(location = 4) in uint chart;
uniform vec2 pixels;      // size of the panel
uniform float thickness;
out float strength;
void main() {
  bool lit = int(chart) == hovered;
  vec4 a = matrix * (plane ? vec4(startUv, 0.0, 1.0) : vec4(startPosition, 1.0));
  vec4 b = matrix * (plane ? vec4(stopUv, 0.0, 1.0) : vec4(stopPosition, 1.0));
  float end = float(gl_VertexID & 1), side = float(gl_VertexID >> 1) * 2.0 - 1.0;
  vec2 along = (b.xy / b.w - a.xy / a.w) * pixels;
  along = length(along) > 1e-6 ? normalize(along) : vec2(1.0, 0.0);
  vec4 p = end < 0.5 ? a : b;
  float wide = thickness * (lit ? 2.0 : 1.0);
  vec2 shift = (side * vec2(-along.y, along.x) + (2.0 * end - 1.0) * 0.5 * along) * wide;
  p.xy += shift / pixels * p.w;
  if (!plane) p.z -= (lit ? 0.0030 : 0.0024) * p.w;   // in front of the faces it lies on
  strength = lit ? 1.0 : hovered >= 0 ? 0.25 : 1.0;
  gl_Position = p.w <= 0.0 ? vec4(2.0, 2.0, 2.0, 1.0) : p;
}`;

const LINE_FRAGMENT = `${COMMON}
uniform vec4 ink;
in float strength;
out vec4 colour;
void main() { colour = vec4(ink.rgb, ink.a * strength); }`;

const GROUND_VERTEX = `${COMMON}
uniform vec4 box;         // corners in stored uv
out vec2 p;
void main() {
  vec2 corner = vec2(gl_VertexID & 1, gl_VertexID >> 1);
  p = mix(box.xy, box.zw, corner);
  gl_Position = matrix * vec4(p, 0.0, 1.0);
}`;

const GROUND_FRAGMENT = `${COMMON}
uniform vec4 uvBox;
uniform vec3 panel;
uniform vec3 hairline;
in vec2 p;
out vec4 colour;
void main() {             // whole tiles, with a hairline between them
  vec2 at = uvBox.xy + p * uvBox.zw;
  vec2 w = fwidth(at), d = abs(at - round(at));
  float line = max(w.x, w.y) < 0.2 ? max(step(d.x, w.x * 0.75), step(d.y, w.y * 0.75)) : 0.0;
  bool unit = all(greaterThan(at, vec2(0.0))) && all(lessThan(at, vec2(1.0)));
  colour = vec4(mix(unit ? panel : mix(panel, hairline, 0.45), hairline * 0.92, line), 1.0);
}`;
