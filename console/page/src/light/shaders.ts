// Light is linear in all shaders, except for the last line of kComposite.

/** One triangle that covers the viewport. */
export const kEverything = `#version 300 es
void main() {
  gl_Position = vec4(gl_VertexID == 1 ? 3.0 : -1.0, gl_VertexID == 2 ? 3.0 : -1.0, 0.0, 1.0);
}`;

export const kHead = `#version 300 es
precision highp float;
precision highp int;
precision highp sampler2D;
precision highp sampler2DArray;
precision highp usampler2D;
`;

/**
 * Resamples a picture along one axis: sample i of the result is the picture's mean over [start + i step, start + (i + 1)
 * step], or, if step < 1, interpolated between two samples. Beyond its edges the picture goes on as it ends (clamp).
 */
export const kResize = `${kHead}
uniform sampler2D u_picture;
uniform bool u_down;
uniform int u_size;  // of the picture, along the axis
uniform ivec2 u_corner;
uniform float u_start, u_step;
uniform mat3 u_seen;
uniform bool u_whole;  // as in kHalveBody
out vec4 o_light;

vec3 at(int i, int across) { return texelFetch(u_picture, u_down ? ivec2(across, i) : ivec2(i, across), 0).rgb; }

void main() {
  ivec2 to = ivec2(gl_FragCoord.xy) - u_corner;
  int across = u_down ? to.x : to.y;
  float low = clamp(u_start + float(u_down ? to.y : to.x) * u_step, -u_step - 1.0, float(u_size) + 1.0);
  vec3 sum = vec3(0.0);
  if (u_step > 1.0) {
    int first = int(floor(low)), last = int(ceil(low + u_step - 1e-4));
    for (int i = first; i < last; ++i) {
      float share = min(low + u_step, float(i + 1)) - max(low, float(i));
      sum += max(share, 0.0) / u_step * at(clamp(i, 0, u_size - 1), across);
    }
  } else {
    float middle = low + 0.5 * u_step - 0.5;
    int i = int(floor(middle));
    sum = mix(at(clamp(i, 0, u_size - 1), across), at(clamp(i + 1, 0, u_size - 1), across), middle - float(i));
  }
  vec3 light = u_seen * sum;
  o_light = vec4(u_whole ? sqrt(light) : light, 1.0);
}`;

const kHalveBody = `
uniform bool u_whole;  // the level goes on as it ends, and keeps roots of light in bytes; else it has a border
const float kFilter[6] = float[](1.0 / 32.0, 5.0 / 32.0, 10.0 / 32.0, 10.0 / 32.0, 5.0 / 32.0, 1.0 / 32.0);
out vec4 o_light;
`;

/** Halves the columns of the level u_above of the pyramid, with its border. */
export const kHalveAcross = `${kHead}${kHalveBody}
uniform sampler2DArray u_pyramid;
uniform int u_layer, u_border;
uniform ivec4 u_above;  // x, y, width, height of its samples
void main() {
  ivec2 to = ivec2(gl_FragCoord.xy) - u_border;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 6; ++k) {
    int x = 2 * to.x + k - 2;
    if (u_whole) x = clamp(x, 0, u_above.z - 1);
    if (x < -u_border || x >= u_above.z + u_border) continue;
    vec3 read = texelFetch(u_pyramid, ivec3(u_above.xy + ivec2(x, to.y), u_layer), 0).rgb;
    sum += kFilter[k] * (u_whole ? read * read : read);
  }
  o_light = vec4(sum, 1.0);
}`;

/** Halves the rows of kHalveAcross's result, into the pyramid. */
export const kHalveDown = `${kHead}${kHalveBody}
uniform sampler2D u_across;
uniform int u_border, u_height;
uniform ivec2 u_corner;  // of the level with its border, in the pyramid
void main() {
  ivec2 to = ivec2(gl_FragCoord.xy) - u_corner;
  vec3 sum = vec3(0.0);
  for (int k = 0; k < 6; ++k) {
    int y = 2 * (to.y - u_border) + k - 2;
    if (u_whole) y = clamp(y, 0, u_height - 1);
    if (y < -u_border || y >= u_height + u_border) continue;
    sum += kFilter[k] * texelFetch(u_across, ivec2(to.x, y + u_border), 0).rgb;
  }
  o_light = vec4(u_whole ? sqrt(sum) : sum, 1.0);
}`;

/**
 * integrate(): the light of a footprint. It is integrated row by row along its wider axis, v: each row (or a third of one)
 * gets a part of the light, which is distributed over the row's samples by its own mean and variance along u. footprints.ts
 * explains how samples of a level represent the picture.
 */
export const integrate = (box: boolean): string => `
uniform sampler2DArray u_pyramid;
uniform int u_border;
const float kReach = ${box ? "1.7320509" : "3.0"};  // in standard deviations

${
  box
    ? `float below(float z) { return clamp(0.5 + z / 3.4641016, 0.0, 1.0); }  // of a box, z in its standard deviations`
    : `
// Abramowitz and Stegun 7.1.28: within 3e-7.
float below(float z) {
  float t = min(abs(z) * 0.70710678, 5.0);
  float p = 0.0001520143 + t * (0.0002765672 + t * 0.0000430638);
  p = 1.0 + t * (0.0705230784 + t * (0.0422820123 + t * (0.0092705272 + t * p)));
  p *= p; p *= p; p *= p; p *= p;
  return 0.5 + 0.5 * sign(z) * (1.0 - 1.0 / p);
}`
}
// Of a level's sample or row; far away ones are all alike.
int cell(float at) { return int(floor(clamp(at, -1e6, 1e6))); }
float density(float z) { return 0.39894228 * exp(-0.5 * z * z); }

// With an explicit level: for implicit derivatives drivers would unroll the loops.
vec3 light_at(vec2 at, int layer, vec2 texel) { return textureLod(u_pyramid, vec3(at * texel, float(layer)), 0.0).rgb; }

// The sum over a row: each look-up reads two neighbours, weighted by its position between their centres. The tails beyond
// the reach go to the samples at its ends.
vec3 integrate_row(float mean, float sigma, float v, float reach, int extent, ivec2 corner, bool exchanged,
                   int layer, vec2 texel) {
  int low = cell(mean - reach * sigma), high = cell(mean + reach * sigma);
  int from = max(low, -u_border), to = min(high, extent + u_border - 1);
  float scale = 1.0 / max(sigma, 1e-5);
  float before = from <= low ? 0.0 : below((float(from) - mean) * scale);
  vec3 sum = vec3(0.0);
  for (int u = from; u <= to; u += 2) {
    float middle = u + 1 > high ? 1.0 : below((float(u + 1) - mean) * scale);
    float after = u + 1 > to ? middle : u + 2 > high ? 1.0 : below((float(u + 2) - mean) * scale);
    float weight = after - before;
    vec2 at = vec2(float(u) + 0.5 + (after - middle) / max(weight, 1e-12), v);
    if (weight > 0.0) sum += weight * light_at(vec2(corner) + (exchanged ? at.yx : at), layer, texel);
    before = after;
  }
  return sum;
}

vec3 integrate(vec2 centre, vec3 q, float brightest, int layer, ivec4 level, vec2 texel) {
  bool exchanged = q.x > q.z;
  float uu = max(exchanged ? q.z : q.x, 0.0), vv = max(exchanged ? q.x : q.z, 0.0);
  vec2 middle = exchanged ? centre.yx : centre;
  ivec2 extent = exchanged ? level.wz : level.zw;
  float sigma = sqrt(vv), slope = vv > 0.0 ? q.y / vv : 0.0, cut = max(uu - slope * q.y, 0.0);
  // A bright mode may be centred beyond the monitor, which then shows only its tail.
  float reach = ${box ? "kReach" : "sqrt(kReach * kReach + 2.0 * log(max(brightest, 1.0)))"};
  // Where the footprint is a thin line, a row's light is uniform along it; with thin rows a Gaussian approximates that.
  int parts = slope * slope > 4.0 * cut ? 3 : 1;
  float part = 1.0 / float(parts);
  int low = cell((middle.y - reach * sigma) * float(parts)), high = cell((middle.y + reach * sigma) * float(parts));
  int from = max(low, -u_border * parts), to = min(high, (extent.y + u_border) * parts - 1);
  vec3 sum = vec3(0.0);
  for (int i = from; i <= to; ++i) {
    float share = 1.0, mean = 0.0, variance = vv, v = float(i) * part;
    if (low < high) {
      float a = (v - middle.y) / sigma, b = a + part / sigma;
      share = (i == high ? 1.0 : below(b)) - (i == low ? 0.0 : below(a));
      float da = i == low ? 0.0 : density(a), db = i == high ? 0.0 : density(b);
      float z = max(share, 1e-6);
      mean = clamp((da - db) / z, i == low ? -5.0 : a, i == high ? 5.0 : b);
      variance = vv * clamp(1.0 + (a * da - b * db) / z - mean * mean, 0.0, 1.0);
      mean *= sigma;
    }
    float pixel = floor(v + 0.5 * part) + 0.5;
    sum += share * integrate_row(middle.x + slope * mean, sqrt(cut + slope * slope * variance), pixel, reach, extent.x,
                                 level.xy, exchanged, layer, texel);
  }
  return sum;
}`;

/**
 * A footprint for pictures that move, in a fourth of the words and the time: where to look, and with what weights. It holds for
 * any shift of its picture, but for one scale, u_scale: the picture's pixels per pixel of the monitor. Up to eight probes stand
 * along the wider axis, evenly, so that they have its variance there beyond that of the narrower axis; each reads the two levels
 * whose blurs enclose the narrower one, mixed so that their variances are right. A reading of level l, interpolated between flat
 * samples, has 4^l 2/3 - 5/12 px^2. Beyond the monitor it is black, by a ramp of the footprint's width.
 */
export const sketch = (levelCount: number, monitorCount: number): string => `${kHead}
uniform usampler2D u_list;
uniform ivec4 u_levels[${levelCount}];  // x, y, width, height
uniform int u_first_level[${monitorCount}], u_last_level[${monitorCount}];  // of a monitor; the last counts from its first
uniform vec2 u_scale[${monitorCount}];
out uvec4 o_sketch;
const float kMaxProbes = 8.0;
// Probes may stand two deviations of their blur apart: eight of them reach 21 times its variance.
const float kMaxRatio = 22.0;
const float kLeastShare = 1.0 / 16.0;  // of a second level

void main() {
  ivec2 from = ivec2(gl_FragCoord.xy) * ivec2(2, 1);
  uvec4 one = texelFetch(u_list, from, 0), two = texelFetch(u_list, from + ivec2(1, 0), 0);
  int monitor = int((two.z >> 16) & 0xffu), last = u_last_level[monitor];
  float size = exp2(float(two.z >> 24)), less = 0.5 * (size * size - 1.0);
  vec2 centre = size * uintBitsToFloat(one.xy), edge = vec2(u_levels[u_first_level[monitor]].zw), scale = u_scale[monitor];
  vec3 q = size * size * vec3(uintBitsToFloat(one.z), uintBitsToFloat(two.x), uintBitsToFloat(one.w)) + vec3(less, 0.0, less);
  vec2 soften = sqrt(12.0 * (max(q.xz, 0.0) + 1.0 / 12.0));
  vec2 shown = clamp(0.5 + centre / soften, 0.0, 1.0) * clamp(0.5 + (edge - centre) / soften, 0.0, 1.0);
  q *= vec3(scale.x * scale.x, scale.x * scale.y, scale.y * scale.y);
  float mean = 0.5 * (q.x + q.z), away = length(vec2(0.5 * (q.x - q.z), q.y));
  float wide = mean + away + 1.0 / 12.0, narrow = max(mean - away + 1.0 / 12.0, max(0.25, wide / kMaxRatio));
  float beyond = max(wide - narrow, 0.0), probes = clamp(floor(sqrt(1.0 + 3.0 * beyond / narrow) + 0.5), 1.0, kMaxProbes);
  vec2 along = vec2(0.0);
  if (probes > 1.0) {
    float more = mean + away;
    along = sqrt(12.0 * beyond / (probes * probes - 1.0)) *
            normalize(q.x > q.z ? vec2(more - q.z, q.y) : vec2(q.y, more - q.x));
  } else {
    narrow += 0.5 * beyond;
  }
  int level = clamp(int(0.5 * log2(1.5 * narrow + 0.625)), 0, max(last - 1, 0));
  float area = exp2(2.0 * float(level)), share = clamp((narrow - (area * 2.0 / 3.0 - 5.0 / 12.0)) / (2.0 * area), 0.0, 1.0);
  if (share < kLeastShare || last == 0) share = 0.0;
  vec3 weight = vec3(unpackHalf2x16(two.y), unpackHalf2x16(two.z).x) * (shown.x * shown.y / probes);
  uint how = uint(monitor) | uint(level) << 3 | uint(63.0 * share + 0.5) << 7 | uint(probes - 1.0) << 13;
  o_sketch = uvec4(packUnorm2x16(0.25 + 0.5 * centre / edge), packHalf2x16(along), how | packHalf2x16(vec2(0.0, weight.b)),
                   packHalf2x16(weight.rg));
}`;

/** A pixel's composite: F and the light of its footprints, light_of() of their numbers. */
const kPixel = `
uniform usampler2D u_pixels;  // F and the footprints of a pixel: surface.ts
uniform int u_step;  // matte pixels per drawn pixel along each side
uniform ivec4 u_view;  // the drawn part of the matte: x, y, width, height
uniform mat3 u_primaries;
uniform float u_gain;
out vec4 o_colour;

vec3 coded(vec3 light) {  // sRGB
  vec3 l = clamp(light, 0.0, 1.0);
  return mix(1.055 * pow(l, vec3(1.0 / 2.4)) - 0.055, 12.92 * l, lessThanEqual(l, vec3(0.0031308)));
}

void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  at.y = (u_view.w + u_step - 1) / u_step - 1 - at.y;  // the canvas counts from below
  at = u_view.xy + min(at * u_step + u_step / 2, u_view.zw - 1);
  uvec4 pixel = texelFetch(u_pixels, at, 0);
  vec3 light = vec3(unpackHalf2x16(pixel.z), unpackHalf2x16(pixel.y).x);
  uint end = pixel.x + (pixel.y >> 16);
  for (uint i = pixel.x; i < end; ++i) light += light_of(int(i));
  o_colour = vec4(coded(u_gain * (u_primaries * light)), 1.0);
}`;

/** The composite of the eight words of each footprint: seen() tells of their light. */
export const kComposite = `
uniform usampler2D u_list;
uniform int u_list_bits;  // 2^bits is its width

vec3 light_of(int footprint) {
  int k = 2 * footprint;
  ivec2 place = ivec2(k & ((1 << u_list_bits) - 1), k >> u_list_bits);
  uvec4 one = texelFetch(u_list, place, 0), two = texelFetch(u_list, place + ivec2(1, 0), 0);
  return vec3(unpackHalf2x16(two.y), unpackHalf2x16(two.z & 0xffffu).x) * seen(one, two);
}
${kPixel}`;

/** The composite before monitors. */
export const composite = (levelCount: number, monitorCount: number, box: boolean): string => `${kHead}
uniform ivec4 u_levels[${levelCount}];  // x, y, width, height
uniform int u_first_level[${monitorCount}];  // of a monitor
${integrate(box)}

vec3 seen(uvec4 one, uvec4 two) {
  int monitor = int((two.z >> 16) & 0xffu), level = int(two.z >> 24);
  vec3 q = vec3(uintBitsToFloat(one.z), uintBitsToFloat(two.x), uintBitsToFloat(one.w));
  vec2 centre = vec2(uintBitsToFloat(one.x), uintBitsToFloat(one.y));
  vec2 texel = 1.0 / vec2(textureSize(u_pyramid, 0).xy);
  return integrate(centre, q, uintBitsToFloat(two.w), monitor, u_levels[u_first_level[monitor] + level], texel);
}
${kComposite}`;

/** The same about, of footprints' sketches and pyramids of whole pictures: u_place says where a monitor shows its own. */
export const movingComposite = (levelCount: number, monitorCount: number): string => `${kHead}
uniform usampler2D u_sketch;
uniform int u_sketch_bits;  // 2^bits is its width
uniform sampler2DArray u_pyramid;
uniform vec4 u_areas[${levelCount}];  // x, y, width, height in the pyramid
uniform int u_first_level[${monitorCount}];
uniform mat3 u_seen[${monitorCount}];
uniform vec4 u_place[${monitorCount}];  // the picture's pixel of a sketch's (0, 0), and its pixels from there to (1, 1)
uniform vec2 u_texel;

vec3 probe(vec2 at, float layer, vec4 area) {
  vec2 inside = clamp(at, vec2(0.5), area.zw - 0.5);
  vec3 root = textureLod(u_pyramid, vec3((area.xy + inside) * u_texel, layer), 0.0).rgb;
  return root * root;
}

vec3 light_of(int footprint) {
  uvec4 read = texelFetch(u_sketch, ivec2(footprint & ((1 << u_sketch_bits) - 1), footprint >> u_sketch_bits), 0);
  int monitor = ${monitorCount === 1 ? "0" : "int(read.z & 7u)"};
  uint level = (read.z >> 3) & 15u, others = (read.z >> 13) & 7u;
  vec2 centre = u_place[monitor].xy + u_place[monitor].zw * unpackUnorm2x16(read.x);
  float share = float((read.z >> 7) & 63u) / 63.0, layer = float(monitor), scale = 1.0;
  int first = u_first_level[monitor];
  vec4 sharp = u_areas[first], soft = u_areas[first + 1];
  if (level > 0u) {
    scale = exp2(-float(level));
    sharp = u_areas[first + int(level)];
    soft = u_areas[first + int(level) + 1];
  }
  vec2 along = vec2(0.0);
  if (others > 0u) {
    along = unpackHalf2x16(read.y);
    centre -= 0.5 * float(others) * along;
  }
  vec3 sum = vec3(0.0);
  for (uint i = 0u; i <= others; ++i) {
    vec2 at = scale * (centre + float(i) * along);
    vec3 light = probe(at, layer, sharp);
    if (share > 0.0) light = mix(light, probe(0.5 * at, layer, soft), share);
    sum += light;
  }
  return u_seen[monitor] * sum * vec3(unpackHalf2x16(read.w), unpackHalf2x16(read.z >> 16).x);
}
${kPixel}`;
