// Surfels on screen as texgs/raster defines them: the forms of fragments, their alpha, texels and light.

import { LAYERS, WIDTH } from "./surfels.js";

/** Those of texgs/scene/frame.py; their places are numbers in the shaders. */
export const MODES = ["shaded", "unshaded", "normal", "depth", "alpha", "texture", "discs", "ambient", "diffuse",
  "specular", "shininess"];

export const PAIRS = ["none", "difference", "wipe"]; // how two pictures are shown
export const MOST_PLANES = 12; // six and a box
const numbered = (names) => names.map((name, k) => `const int ${name.toUpperCase()} = ${k};`).join("\n");
const layers = numbered(LAYERS);
const looks = numbered(MODES).replaceAll("const int ", "const int LOOK_");

export const SURFEL_VERTEX = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp usampler2D;

${layers}
${looks}
const float ALPHA_MIN = 1.0 / 255.0;
const float DISC = 1e6;          // opacity that makes a surfel a disc with a sharp rim
const float NARROW = 0.1856399;  // scale at which this disc has a radius of one standard deviation
const float FAR = 1e4;           // a distant viewer, world units
const float SMALLEST = 1e-30;    // a cosine below is 0

uniform sampler2DArray surfels;
uniform usampler2D lookups;
uniform usampler2D order;        // of the surfels, which have four vertices each
uniform sampler2D parts;
uniform sampler2D shares;        // of the light of the lamp and from all around that reach surfels
uniform vec2 strengths;          // of shadows and of occlusion
uniform mat3 rotation;           // world to camera
uniform vec3 translation;
uniform vec2 focal, size;        // pixels
uniform vec3 light;              // direction to it
uniform bool headlight;
uniform float low_pass, near, texel_step;
uniform int look;

flat out vec2 centre;            // of the low-pass filter, pixels
flat out vec4 forms;             // d(U, V) by the pixel: ux, uy, vx, vy
flat out vec3 perspective;       // dW by the pixel, and the depth of the mean
flat out vec4 base;              // colour, and the logarithm (base 2) of the opacity
flat out float gain;             // of a step of a texel
flat out uvec3 texture_place;    // first texel, texels along u and v

struct Axes { vec3 u, v, n; };

Axes axes(vec4 q) {              // q: w, x, y, z
  float w = q.x, x = q.y, y = q.z, z = q.w;
  return Axes(vec3(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
              vec3(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
              vec3(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)));
}

vec3 unit(vec3 a) {
  float l = length(a);
  return l > SMALLEST ? a / l : vec3(0.0);
}

// Blinn-Phong: gain in w, and gain * colour + highlight. See texgs/raster/shading.py.
vec4 shade(vec3 color, vec4 material, vec3 tint, vec3 mean, vec3 n, bool near_viewer, bool facing) {
  vec3 eye = near_viewer ? -translation * rotation : -FAR * vec3(rotation[0].z, rotation[1].z, rotation[2].z);
  vec3 v = unit(eye - mean), l = headlight ? v : unit(light), h = headlight ? v : unit(v + l);
  float n_l = dot(n, l), n_h = dot(n, h);
  float lobe = pow(max(abs(n_h), SMALLEST), material.w);
  bool shadow = facing && (dot(n, v) < 0.0 ? -n_l : n_l) <= 0.0;
  if (shadow) n_l = 0.0, lobe = 0.0;
  float g = material.x + material.y * abs(n_l);
  return vec4(clamp(g * color + material.z * lobe * tint, 0.0, 1.0), g);
}

// sigma^2 (a.x b.x + a.y b.y) - a.z b.z: an entry of the conic that the surfel's edge becomes.
float conic(float sigma2, vec3 a, vec3 b) {
  return sigma2 * (a.x * b.x + a.y * b.y) - a.z * b.z;
}

// Rows of the homography from (u, v, 1) to pixels, counted from the low-pass centre: the mean on screen.
struct Rows { vec3 u, v, w; };

Rows homography(vec3 a, vec3 b, vec3 p, vec2 middle) {
  vec3 w = vec3(a.z, b.z, p.z);
  vec2 u = focal.x * vec2(a.x, b.x) - middle.x * w.xy, v = focal.y * vec2(a.y, b.y) - middle.y * w.xy;
  return Rows(vec3(u, 0.0), vec3(v, 0.0), w);
}

// Below this ratio of the sides of its image a surfel is seen edge-on: only the low-pass disc is left of it.
bool is_edge_on(Rows m, float determinant) {
  return abs(determinant) <= 1e-6 * (dot(m.u.xy, m.u.xy) + dot(m.v.xy, m.v.xy));
}

// The box of u^2 + v^2 <= cut from the low-pass centre, low and high corner; a little larger, because a thin ellipse
// is ill-conditioned.
vec4 ellipse_box(Rows m, float cut, float ww) {
  vec2 middle = vec2(conic(cut, m.u, m.w), conic(cut, m.v, m.w)) / ww;
  vec2 squared = middle * middle - vec2(conic(cut, m.u, m.u), conic(cut, m.v, m.v)) / ww;
  vec2 reach = sqrt(max(squared, 0.0) * (1.0 + 1e-6) + 2e-2);
  return vec4(middle - reach, middle + reach);
}

// The pixels in which alpha can reach ALPHA_MIN, low and high corner: those of the ellipse and the low-pass disc.
vec4 box_of(Rows m, bool edge_on, float opacity) {
  float cut = max(2.0 * log(opacity / ALPHA_MIN) * 1.0001 + 1e-3, 1e-3);
  float ww = conic(cut, m.w, m.w), depth = m.w.z, radius = sqrt(cut / low_pass);
  bool reaches_behind = ww > -1e-3 * depth * depth && depth - sqrt(cut * dot(m.w.xy, m.w.xy)) <= near;
  if (reaches_behind) return vec4(vec2(0.0), size);
  vec4 box = vec4(vec2(-radius), vec2(radius));
  if (!edge_on) {
    vec4 ellipse = ellipse_box(m, cut, ww);
    box = vec4(min(box.xy, ellipse.xy), max(box.zw, ellipse.zw));
  }
  // Whole pixels: cards round corners to a fraction of one, and pixels at the edge of the box would be lost.
  return vec4(max(floor(box.xy + centre), vec2(0.0)), min(ceil(box.zw + centre), size));
}

// The colour of each mode of texgs/scene/frame.py, and the factor on texels.
vec4 colour_of(vec3 color, vec4 material, vec3 tint, vec3 mean, vec3 n, vec4 flags) {
  vec3 to_eye = -translation * rotation - mean;
  if (look == LOOK_UNSHADED) return vec4(color, 1.0);
  if (look == LOOK_NORMAL) return vec4(0.5 + 0.5 * (dot(n, to_eye) < 0.0 ? -n : n), 0.0);
  if (look == LOOK_ALPHA) return vec4(vec3(1.0), 0.0);
  if (look == LOOK_SHININESS) return vec4(vec3(material.w / 100.0), 0.0);
  if (look >= LOOK_AMBIENT && look < LOOK_SHININESS) return vec4(vec3(material[look - LOOK_AMBIENT]), 0.0);
  if (look == LOOK_TEXTURE) return vec4(vec3(0.5), 1.0);
  vec4 shaded = shade(color, material, tint, mean, n, flags.x > 0.5, flags.y > 0.5);
  return look == LOOK_DISCS ? vec4(shaded.rgb, 0.0) : shaded;
}

void main() {
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0); // off screen, where nothing is drawn
  int place_in_order = gl_VertexID / 4;
  uint surfel = texelFetch(order, ivec2(place_in_order % ${WIDTH}, place_in_order / ${WIDTH}), 0).x;
  ivec2 at = ivec2(surfel % ${WIDTH}u, surfel / ${WIDTH}u);
  vec4 place = texelFetch(surfels, ivec3(at, PLACE), 0);
  uvec4 lookup = texelFetch(lookups, at, 0);
  vec4 part = texelFetch(parts, ivec2(0, lookup.w), 0);
  float opacity = min(place.w * part.w, 1.0);
  if (look == LOOK_DISCS && opacity > 0.0) opacity = DISC;
  if (opacity < ALPHA_MIN) return;

  Axes world = axes(normalize(texelFetch(surfels, ivec3(at, QUATS), 0)));
  vec2 scales = (look == LOOK_DISCS ? NARROW : 1.0) * texelFetch(surfels, ivec3(at, SCALES), 0).xy;
  vec3 p = rotation * place.xyz + translation;
  vec3 a = scales.x * (rotation * world.u), b = scales.y * (rotation * world.v);

  vec2 middle = focal * p.xy / p.z;
  Rows m = homography(a, b, p, middle);
  vec3 A = cross(m.v, m.w), B = cross(m.w, m.u); // with C, the columns of the adjugate
  float C = m.u.x * m.v.y - m.u.y * m.v.x;
  bool edge_on = is_edge_on(m, C);
  float steep = 1e4 * sqrt(low_pass), scale = edge_on ? 0.0 : 1.0 / C;
  centre = middle + 0.5 * size;
  forms = edge_on ? vec4(steep, 0.0, 0.0, steep) : scale * vec4(A.x, B.x, A.y, B.y);
  perspective = vec3(scale * A.z, scale * B.z, p.z);
  vec4 box = box_of(m, edge_on, opacity);
  if (any(greaterThanEqual(box.xy, box.zw))) return;

  vec4 material = texelFetch(surfels, ivec3(at, MATERIAL), 0) * texelFetch(parts, ivec2(1, lookup.w), 0);
  vec3 color = texelFetch(surfels, ivec3(at, COLORS), 0).xyz + part.xyz;
  vec4 flags = texelFetch(parts, ivec2(2, lookup.w), 0);
  vec3 tint = texelFetch(parts, ivec2(3, lookup.w), 0).rgb;
  vec3 n = axes(normalize(texelFetch(surfels, ivec3(at, NORMALS), 0))).n;
  if (look == LOOK_SHADED || look == LOOK_DISCS) {
    material.xyz *= (1.0 - strengths * (1.0 - texelFetch(shares, at, 0).xy)).yxx;
  }
  vec4 shaded = colour_of(color, material, tint, place.xyz, n, flags);
  base = vec4(shaded.xyz, log2(opacity));
  gain = shaded.w * texel_step;
  texture_place = lookup.xyz;
  vec2 corner = vec2(gl_VertexID & 1, (gl_VertexID >> 1) & 1);
  gl_Position = vec4(2.0 * mix(box.xy, box.zw, corner) / size - 1.0, 0.0, 1.0); // the first row of the target is the top
}
`;

export const SURFEL_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp isampler2D;

${looks}
const float LOG2_E = 1.44269504;
const float ALPHA_MAX = 0.99, ALPHA_MIN = 1.0 / 255.0;

uniform isampler2D texels;
uniform int look;
uniform float low_pass, near;
uniform vec2 focal, size;        // pixels
uniform int n_planes;
uniform vec4 planes[${MOST_PLANES}]; // normal and offset in the camera's axes: what is beyond is cut away
uniform sampler2D weights;       // of faces
uniform float reach;             // of a slab behind faces, world units, which hides what is in it

flat in vec2 centre;
flat in vec4 forms;
flat in vec3 perspective;
flat in vec4 base;
flat in float gain;
flat in uvec3 texture_place;
out vec4 fragment;               // premultiplied

vec3 fetch(int index) {
  return vec3(texelFetch(texels, ivec2(index % ${WIDTH}, index / ${WIDTH}), 0).xyz);
}

// Bilinear between texel centres; the texture spans 3 standard deviations to either side, its edge is replicated.
vec3 texel(vec2 uv) {
  ivec2 sizes = ivec2(texture_place.yz), last = sizes - 1;
  vec2 x = clamp(uv * vec2(sizes) / 6.0 + 0.5 * vec2(last), vec2(0.0), vec2(last));
  ivec2 cell = min(ivec2(x), max(last - 1, 0)), next = min(last, 1) * ivec2(1, sizes.x);
  vec2 f = x - vec2(cell);
  int first = int(texture_place.x) + cell.y * sizes.x + cell.x;
  return mix(mix(fetch(first), fetch(first + next.x), f.x),
             mix(fetch(first + next.y), fetch(first + next.x + next.y), f.x), f.y);
}

void main() {
  vec2 d = gl_FragCoord.xy - centre;
  float w = 1.0 + dot(perspective.xy, d);
  bool in_front = w > 0.0 && w * near < perspective.z;
  if (abs(w) < 1e-12) w = 1e-12; // keeps (u, v) finite
  vec2 uv = vec2(dot(forms.xy, d), dot(forms.zw, d)) / w;
  float of_surfel = in_front ? dot(uv, uv) : 1e30, rho = min(of_surfel, low_pass * dot(d, d));
  float alpha = min(exp2(base.w - 0.5 * LOG2_E * rho), ALPHA_MAX);
  float depth = of_surfel <= rho ? perspective.z / w : perspective.z;
  vec3 ray = vec3((gl_FragCoord.xy - 0.5 * size) / focal, 1.0);
  float enters = 0.0;
  for (int k = 0; k < n_planes; k++) {
    float away = dot(planes[k].xyz, ray);
    if (depth * away > planes[k].w) discard;
    if (away < 0.0) enters = max(enters, planes[k].w / away);
  }
  if (alpha < ALPHA_MIN) discard;
  if (reach > 0.0 && enters > 0.0 && (depth - enters) * length(ray) < reach * texture(weights, gl_FragCoord.xy / size).r) discard;
  vec3 color = gain == 0.0 ? base.xyz : base.xyz + gain * texel(uv);
  if (look == LOOK_DEPTH) color = vec3(depth);
  fragment = vec4(alpha * color, alpha);
}
`;

export const PRESENT_VERTEX = `#version 300 es
void main() { // one triangle over the whole screen
  gl_Position = vec4(4.0 * float(gl_VertexID & 1) - 1.0, 2.0 * float(gl_VertexID & 2) - 1.0, 0.0, 1.0);
}
`;

export const PRESENT_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
${numbered(PAIRS)}
uniform sampler2D picture, other;
uniform int pair;                // how two pictures are shown
uniform float gain, wipe;        // of differences, and the part of the width that shows the first picture
uniform vec3 background;
uniform vec2 range;              // of depths, which are shown where it is not empty
out vec4 shown;

vec3 behind(vec4 a) { return a.rgb + (1.0 - a.a) * background; }

// The largest difference of a channel: red above 0, blue below.
vec3 difference(vec3 one, vec3 two) {
  vec3 d = clamp(one, 0.0, 1.0) - clamp(two, 0.0, 1.0), a = abs(d);
  float x = gain * (a.r >= max(a.g, a.b) ? d.r : a.g >= a.b ? d.g : d.b);
  return vec3(1.0 + min(x, 0.0), 1.0 - abs(x), 1.0 - max(x, 0.0));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  at.y = textureSize(picture, 0).y - 1 - at.y;
  vec4 blended = texelFetch(picture, at, 0);
  if (pair != NONE) {
    vec4 second = texelFetch(other, at, 0);
    bool is_first = gl_FragCoord.x < wipe * float(textureSize(picture, 0).x);
    if (pair == WIPE && !is_first) blended = second;
    if (pair == DIFFERENCE) blended = vec4(difference(behind(blended), behind(second)), 1.0);
  }
  if (range.y > 0.0) {
    float depth = blended.r / max(blended.a, 1e-12), place = (depth - range.x) / max(range.y - range.x, 1e-6);
    blended.rgb = vec3(0.9 * clamp(place, 0.0, 1.0) * blended.a);
  }
  shown = vec4(behind(blended), 1.0);
}
`;
