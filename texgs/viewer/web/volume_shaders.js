// Rays through a volume as texgs/volume/caster.py defines them, and the soft rims of faces.

import { BRICK } from "./bricks.js";
import { SIZE } from "./function_table.js";
import { MOST_PLANES } from "./shaders.js";

export const VOLUME_FRAGMENT = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
precision highp usampler3D;

const float LEAST_LIGHT = 1e-3;  // below which a ray ends
const float FLAT = 1e-6;         // a slope without direction

uniform sampler3D samples;       // codes
uniform usampler3D bricks;       // distances, with one more brick on each side
uniform sampler2D table;         // by values: colours and extinctions; below, their integrals
uniform sampler2D weights;       // of faces
uniform sampler3D lamp, sky;     // shares of light that reach cells
uniform vec2 strengths, outsets; // of shadows and of occlusion, and how far along normals to look for light, world units
uniform mat3 rotation;           // world to camera
uniform vec3 translation;
uniform vec2 focal, size;        // pixels
uniform vec3 box;                // half its sides, world units
uniform float interval, unit;    // distance of samples, and the length that opacities are for, world units
uniform float reach;             // behind faces, world units; 0: no end
uniform vec3 viewer, light;      // directions to them
uniform vec4 material;
uniform vec3 tint;               // of highlights
uniform bool are_faces_lit, is_depth;
uniform int n_planes;
uniform vec4 planes[${MOST_PLANES}]; // normals and offsets in the world

out vec4 fragment;                 // premultiplied

float least(vec3 a) { return min(a.x, min(a.y, a.z)); }
float most(vec3 a) { return max(a.x, max(a.y, a.z)); }

// What reaches a point of the world of the lamp and of ambient light: 1 without matter in their way.
vec2 exposed(vec3 point, vec3 n) {
  if (strengths == vec2(0.0)) return vec2(1.0);
  float of_lamp = texture(lamp, 0.5 + 0.5 * (point + outsets.x * n) / box).r;
  return 1.0 - strengths * (1.0 - vec2(of_lamp, texture(sky, 0.5 + 0.5 * (point + outsets.y * n) / box).r));
}

// Blinn-Phong, on the side of the viewer, at a point of the world.
vec3 lit(vec3 color, vec3 normal, vec3 point) {
  vec3 n = dot(normal, viewer) < 0.0 ? -normal : normal, between = viewer + light;
  vec2 share = exposed(point, n);
  float n_l = max(dot(n, light), 0.0), n_h = dot(between, between) > 0.0 ? max(dot(n, normalize(between)), 0.0) : 0.0;
  float highlight = n_l > 0.0 ? share.x * material.z * pow(max(n_h, 1e-30), material.w) : 0.0;
  return clamp(color * (share.y * material.x + share.x * material.y * n_l) + highlight * tint, 0.0, 1.0);
}

// The normal at a place of the texture, 0 where nothing changes.
vec3 normal_at(vec3 place, vec3 texel) {
  vec3 slope, per_length = (1.0 / texel - 1.0) / box;
  for (int a = 0; a < 3; a++) {
    vec3 step = vec3(0.0);
    step[a] = texel[a];
    slope[a] = (texture(samples, place + step).r - texture(samples, place - step).r) * per_length[a] / most(per_length);
  }
  return dot(slope, slope) > FLAT * FLAT ? normalize(slope) : vec3(0.0);
}

float value_at(vec3 place, vec3 last) {
  return texture(samples, (clamp(place, vec3(0.0), last) + 0.5) / (last + 1.0)).r;
}

// The mean colour and extinction of all values between two.
vec4 mean_between(float one, float two) {
  float from = ${SIZE - 1}.0 * one, to = ${SIZE - 1}.0 * two;
  if (abs(to - from) < 1.0) return texelFetch(table, ivec2(0.5 * (from + to) + 0.5, 0), 0);
  ivec2 ends = ivec2(vec2(from, to) + 0.5);
  vec4 sum = (texelFetch(table, ivec2(ends.y, 1), 0) - texelFetch(table, ivec2(ends.x, 1), 0)) / float(ends.y - ends.x);
  return vec4(sum.rgb / max(sum.a, 1e-9), sum.a);
}

void main() {
  vec3 camera = vec3((gl_FragCoord.xy - 0.5 * size) / focal, 1.0); // the first row of the target is the top
  vec3 along = normalize(camera * rotation), from = -translation * rotation;
  along = mix(along, vec3(1e-12), equal(along, vec3(0.0)));
  vec3 one = (-box - from) / along, other = (box - from) / along;
  float near = max(most(min(one, other)), 0.0), far = least(max(one, other));
  float begin = 0.0, end = 1e9;
  int face = -1;
  for (int k = 0; k < n_planes; k++) {
    float towards = dot(planes[k].xyz, along), distance = (planes[k].w - dot(planes[k].xyz, from)) / towards;
    if (towards < 0.0 && distance > begin) begin = distance, face = k;
    if (towards >= 0.0) end = min(end, distance);
  }
  if (begin >= end) face = -1;
  float face_end = begin + unit;
  if (reach > 0.0) end = face < 0 ? begin : min(end, begin + reach * texture(weights, gl_FragCoord.xy / size).r);

  vec3 last = vec3(textureSize(samples, 0) - 1), texel = 1.0 / (last + 1.0);
  vec3 entry = 0.5 * last + 0.5 * last / box * (from + near * along), stride = 0.5 * last / box * interval * along;
  ivec3 n_bricks = textureSize(bricks, 0) - 2;
  float begins = (begin - near) / interval, ends = (end - near) / interval;
  float k = floor(max(begins, 0.0)), stop = min(ceil((far - near) / interval - 0.5), ceil(ends));
  float clear = 1.0, before = 0.0, before_at = -1.0; // light that is left; the value where a step begins
  vec3 sum = vec3(0.0);
  while (k < stop && clear >= LEAST_LIGHT) {
    vec3 place = clamp(entry + (k + 0.5) * stride, vec3(0.0), last);
    ivec3 brick = min(ivec3(place) / ${BRICK}, n_bricks - 1);
    int distance = int(texelFetch(bricks, brick + 1, 0).r);
    if (distance > 0) {
      vec3 ahead = vec3(brick + distance), back = vec3(brick - distance + 1);
      vec3 side = float(${BRICK}) * mix(ahead, back, lessThan(stride, vec3(0.0)));
      k += max(ceil(least((side - place) / stride) - 1e-3), 1.0);
      continue;
    }
    if (before_at != k) before = value_at(entry + k * stride, last);
    float behind = value_at(entry + (k + 1.0) * stride, last);
    vec4 look = mean_between(before, behind);
    if (look.a > 0.0) {
      float part = min(k + 1.0, ends) - max(k, begins), alpha = 1.0 - exp2(-look.a * part * interval / unit);
      float of_face = face < 0 ? 0.0 : clamp((face_end - near) / interval - k, 0.0, 1.0);
      vec3 point = box * (2.0 * place / last - 1.0);
      vec3 color = of_face < 1.0 ? lit(look.rgb, normal_at((place + 0.5) * texel, texel), point) : vec3(0.0);
      if (of_face > 0.0) color = mix(color, are_faces_lit ? lit(look.rgb, planes[face].xyz, point) : look.rgb, of_face);
      if (is_depth) color = vec3((near + (k + 0.5) * interval) / length(camera));
      sum += clear * alpha * color;
      clear *= 1.0 - alpha;
    }
    before = behind;
    k += 1.0;
    before_at = k;
  }
  fragment = vec4(sum, 1.0 - clear);
}
`;

// The largest value around a pixel; of values farther than `pixels`, rows or columns, a share counts, falling to 0.
export const GROW_FRAGMENT = `#version 300 es
precision highp float;
precision highp sampler2D;
uniform sampler2D picture;
uniform int channel, pixels;
uniform float gain;
out vec4 shown;
void main() {
  ivec2 middle = ivec2(gl_FragCoord.xy), far = ivec2(2 * pixels);
  ivec2 first = max(middle - far, 0), last = min(middle + far, textureSize(picture, 0) - 1);
  float high = 0.0;
  for (int y = first.y; y <= last.y; y++) for (int x = first.x; x <= last.x; x++) {
    float value = min(gain * texelFetch(picture, ivec2(x, y), 0)[channel], 1.0);
    int away = max(abs(x - middle.x), abs(y - middle.y));
    high = max(high, value * min(float(2 * pixels + 1 - away) / float(pixels + 1), 1.0));
  }
  shown = vec4(high);
}
`;
