// Rays through channels of a volume as texgs/volume/caster.py defines them, and the soft rims of faces.

import { BRICK } from "./bricks.js";
import { SIZE, halfOf } from "./function_table.js";
import { MOST_PLANES } from "./shaders.js";

export const PER_TEXTURE = 4; // channels

/**
 * The shader of sources, see function_table.js: where several are at one place, their extinctions add up. What each
 * step needs of them is written out, as arrays are slow on some cards; what only shown ones need is not, as drivers
 * take long for long shaders.
 *
 * @param {object[]} sources
 * @param {object[]} channels of the page, some in each texture of samples.
 */
export function volumeFragment(sources, channels) {
  const textures = Math.ceil(channels.length / PER_TEXTURE);
  const each = (line) => Array.from({ length: textures }, (_, t) => line(t)).join(" ");
  const ofEach = (line) => sources.map(line).filter(Boolean).join("\n    ");
  const texture = (channel) => Math.floor(channel / PER_TEXTURE), place = (channel) => "rgba"[channel % PER_TEXTURE];
  const isAlone = channels.length === 1, read = (t) => `texture(samples${t}, at)${isAlone ? ".r" : ""}`;
  const code = (name, channel) => `${name}${texture(channel)}${isAlone ? "" : `.${place(channel)}`}`;
  const codesOf = (name) => `${isAlone ? "float" : "vec4"} ${Array.from({ length: textures }, (_, t) => `${name}${t}`)}`;
  const codes = (channel) => ["before", "behind"].map((side) => code(side, channel)).join(", ");
  const shade = (look, channel) => `vec3 normal = of_face < 1.0 ? normal_at(${channel}, middle, texel) : vec3(0.0);
        color += ${look}.a / all * shown(${look}.rgb, normal, of_face, face, point);`;
  return `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler3D;
precision highp usampler3D;

const float LEAST_LIGHT = 1e-3;  // below which a ray ends
const float FLAT = 1e-6;         // a slope without direction
const int SOURCES = ${sources.length};
const int CHANNELS[SOURCES] = int[SOURCES](${sources.map(({ channel }) => channel).join(", ")});

${each((t) => `uniform sampler3D samples${t};`)} // codes of channels
uniform usampler3D bricks;       // distances, with one more brick on each side
uniform sampler2D table;         // by values: colours and extinctions of each source; below, their integrals
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
uniform bool is_slice;           // whether faces show it
uniform vec2 window;             // codes that it shows in black and in white
uniform vec4 labels[${channels.length}];       // of channels: colours, and how much they cover
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

// The code of a channel at a place of the textures.
float code_at(int channel, vec3 at) {
  ${isAlone ? `return ${read(0)};` : `vec4 codes;
  ${each((t) => `if (channel / ${PER_TEXTURE} == ${t}) codes = ${read(t)};`)}
  return codes[channel % ${PER_TEXTURE}];`}
}

// The normal of a channel at a place of the textures, 0 where nothing changes.
vec3 normal_at(int channel, vec3 place, vec3 texel) {
  vec3 slope, per_length = (1.0 / texel - 1.0) / box;
  for (int a = 0; a < 3; a++) {
    vec3 step = vec3(0.0);
    step[a] = texel[a];
    slope[a] = (code_at(channel, place + step) - code_at(channel, place - step)) * per_length[a] / most(per_length);
  }
  return dot(slope, slope) > FLAT * FLAT ? normalize(slope) : vec3(0.0);
}

// The part of a step from one code of a mask to another that is in it.
float part_in(float one, float two, float half_code) {
  return clamp((max(one, two) - half_code) / max(abs(two - one), 1e-6), 0.0, 1.0);
}

// The mean colour and extinction of all values between two, by the row of a table.
vec4 mean_between(int row, float one, float two) {
  float from = ${SIZE - 1}.0 * one, to = ${SIZE - 1}.0 * two;
  if (abs(to - from) < 1.0) return texelFetch(table, ivec2(0.5 * (from + to) + 0.5, row), 0);
  ivec2 ends = ivec2(vec2(from, to) + 0.5);
  vec4 sum = texelFetch(table, ivec2(ends.y, row + 1), 0) - texelFetch(table, ivec2(ends.x, row + 1), 0);
  sum /= float(ends.y - ends.x);
  return vec4(sum.rgb / max(sum.a, 1e-9), sum.a);
}

// The colour of a slice at a place of the textures: the first channel in grey, and labels over it.
vec3 slice_at(vec3 at) {
  ${codesOf("here")};
  ${each((t) => `here${t} = ${read(t)};`)}
  vec3 color = vec3(clamp((${code("here", 0)} - window.x) / (window.y - window.x), 0.0, 1.0));
  ${channels.map((own, c) =>
    `if (${code("here", c)} >= ${halfOf(own).toFixed(6)}) color = mix(color, labels[${c}].rgb, labels[${c}].a);`).join("\n  ")}
  return color;
}

// A colour in the light, as far as it does not belong to a face.
vec3 shown(vec3 color, vec3 normal, float of_face, int face, vec3 point) {
  vec3 own = of_face < 1.0 ? lit(color, normal, point) : vec3(0.0);
  return of_face > 0.0 ? mix(own, are_faces_lit ? lit(color, planes[face].xyz, point) : color, of_face) : own;
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

  vec3 last = vec3(textureSize(samples0, 0) - 1), texel = 1.0 / (last + 1.0);
  vec3 at_face = from + begin * along;
  if (is_slice && face >= 0 && begin < end && most(abs(at_face) - box) <= 1e-5) {
    vec3 at = (0.5 * last + 0.5 * last / box * at_face + 0.5) * texel;
    fragment = vec4(is_depth ? vec3(begin / length(camera)) : slice_at(at), 1.0);
    return;
  }
  vec3 entry = 0.5 * last + 0.5 * last / box * (from + near * along), stride = 0.5 * last / box * interval * along;
  ivec3 n_bricks = textureSize(bricks, 0) - 2;
  float begins = (begin - near) / interval, ends = (end - near) / interval;
  float k = floor(max(begins, 0.0)), stop = min(ceil((far - near) / interval - 0.5), ceil(ends));
  float clear = 1.0, before_at = -1.0; // light that is left; where values before a step are from
  ${codesOf("before")};
  ${codesOf("behind")};
  vec3 sum = vec3(0.0);
  float halfway = 0.0; // depth at which half of the light is gone
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
    if (before_at != k) {
      vec3 at = (clamp(entry + k * stride, vec3(0.0), last) + 0.5) / (last + 1.0);
      ${each((t) => `before${t} = ${read(t)};`)}
    }
    vec3 at = (clamp(entry + (k + 1.0) * stride, vec3(0.0), last) + 0.5) / (last + 1.0);
    ${each((t) => `behind${t} = ${read(t)};`)}
    ${ofEach(({ channel }, s) => `vec4 look${s} = mean_between(${2 * s}, ${codes(channel)});`)}
    ${ofEach(({ mask, half }, s) => mask < 0 ? "" : `look${s}.a *= part_in(${codes(mask)}, ${half.toFixed(6)});`)}
    float all = ${sources.map((_, s) => `look${s}.a`).join(" + ")};
    if (all > 0.0) {
      float part = min(k + 1.0, ends) - max(k, begins), alpha = 1.0 - exp2(-all * part * interval / unit);
      float of_face = face < 0 ? 0.0 : clamp((face_end - near) / interval - k, 0.0, 1.0);
      vec3 middle = (place + 0.5) * texel, point = box * (2.0 * place / last - 1.0), color = vec3(0.0);
      ${sources.length === 1 ? shade("look0", sources[0].channel)
    : `vec4 looks[SOURCES] = vec4[SOURCES](${sources.map((_, s) => `look${s}`).join(", ")});
      for (int s = 0; s < SOURCES; s++) if (looks[s].a > 0.0) {
        ${shade("looks[s]", "CHANNELS[s]")}
      }`}
      if (is_depth) {
        color = vec3((near + (k + 0.5) * interval) / length(camera));
        if (clear > 0.5 && clear * (1.0 - alpha) <= 0.5) halfway = color.x;
      }
      sum += clear * alpha * color;
      clear *= 1.0 - alpha;
    }
    ${each((t) => `before${t} = behind${t};`)}
    k += 1.0;
    before_at = k;
  }
  fragment = vec4(halfway > 0.0 ? vec3(halfway * (1.0 - clear)) : sum, 1.0 - clear);
}
`;
}

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
