// The shaders of environments (environment.ts). Directions are in the map's frame, which has no turn.
import { integrate, kComposite, kHead } from "./shaders";

/** Of a bundle on a face, as in core/rays/surroundings.h: its half side at distance 1. */
export const kHalfSide = 1.25;
export const kMaxLevels = 16;

const kPi = `const float kPi = 3.14159265;
// Column u of W has the longitude 2 pi (u / W - 1/2), row v of H the angle pi v / H from straight up.
vec2 on_map(vec3 d) { return vec2(atan(d.x, d.z) / (2.0 * kPi) + 0.5, acos(clamp(-d.y, -1.0, 1.0)) / kPi); }
`;

/** The picture's light, in the camera's channels. */
export const kLight = `${kHead}
uniform sampler2D u_picture;
uniform bool u_exponent;  // the picture is Radiance's, with an exponent instead of alpha
uniform mat3 u_seen;
out vec4 o_light;
void main() {
  vec4 read = texelFetch(u_picture, ivec2(gl_FragCoord.xy), 0);
  vec3 light = u_exponent ? 255.0 * read.rgb * exp2(255.0 * read.a - 136.0) : read.rgb;
  o_light = vec4(clamp(u_seen * light, -60000.0, 60000.0), 1.0);  // of 16-bit floats
}`;

/** A face: each of its pixels is the mean of the picture's, which are flat, at sixteen places. */
export const kFace = `${kHead}
uniform sampler2D u_picture;
uniform int u_face, u_side;
uniform ivec2 u_corner;
out vec4 o_light;
${kPi}
vec2 on_picture(vec2 pixel) {
  vec3 d = vec3(u_face % 2 == 0 ? 1.0 : -1.0, (pixel / float(u_side) * 2.0 - 1.0) * ${kHalfSide});
  return on_map(normalize(u_face < 2 ? d : u_face < 4 ? d.zxy : d.yzx));
}
vec2 unwrapped(vec2 step) { return vec2(step.x - round(step.x), step.y); }

void main() {
  vec2 pixel = floor(gl_FragCoord.xy) - vec2(u_corner);
  // Within a pixel the picture is flat, as good as anywhere but at the poles.
  vec2 corner = on_picture(pixel), across = unwrapped(on_picture(pixel + vec2(1.0, 0.0)) - corner),
       down = unwrapped(on_picture(pixel + vec2(0.0, 1.0)) - corner);
  ivec2 size = textureSize(u_picture, 0);
  vec3 sum = vec3(0.0);
  for (int s = 0; s < 16; ++s) {
    vec2 part = (vec2(s % 4, s / 4) + 0.5) / 4.0, at = corner + part.x * across + part.y * down;
    ivec2 place = ivec2(floor(vec2(fract(at.x), clamp(at.y, 0.0, 1.0)) * vec2(size)));
    sum += texelFetch(u_picture, min(place, size - 1), 0).rgb;
  }
  o_light = vec4(sum / 16.0, 1.0);
}`;

/** narrow(): the light of a bundle of up to some degrees, whose covariance c is (xx, yy, xy) along e1 and e2. */
const kNarrow = `${integrate(false)}
uniform ivec4 u_levels[${kMaxLevels}];
uniform int u_level_count;

vec3 facing(vec3 v, int axis) { return axis == 0 ? v.yzx : axis == 1 ? v.zxy : v; }

vec3 narrow(vec3 d, vec3 e1, vec3 e2, vec3 c) {
  vec3 size = abs(d);
  int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  vec3 f = facing(d, axis), g1 = facing(e1, axis), g2 = facing(e2, axis);
  float along = abs(f.z), sign = f.z < 0.0 ? -1.0 : 1.0;
  float scale = float(u_levels[0].z) / ${(2 * kHalfSide).toFixed(2)};
  vec2 at = f.xy / along;
  vec2 j1 = scale / along * (g1.xy - at * sign * g1.z), j2 = scale / along * (g2.xy - at * sign * g2.z);
  float xx = c.x * j1.x * j1.x + 2.0 * c.z * j1.x * j2.x + c.y * j2.x * j2.x;
  float yy = c.x * j1.y * j1.y + 2.0 * c.z * j1.y * j2.y + c.y * j2.y * j2.y;
  float xy = c.x * j1.x * j1.y + c.z * (j1.x * j2.y + j1.y * j2.x) + c.y * j2.x * j2.y;
  // The level that suits the smaller width (footprints.ts), or one that makes do with so many rows.
  const float kMinVariance = 0.32, kMaxRows = 48.0;
  float mean = 0.5 * (xx + yy), away = length(vec2(0.5 * (xx - yy), xy));
  float suits = 0.5 * log2((max(mean - away, 0.0) + 0.5) / (kMinVariance + 0.5));
  float rows = log2(max(2.0 * kReach * sqrt(mean + away) / kMaxRows, 1.0));
  int level = clamp(int(max(floor(suits), ceil(rows))), 0, u_level_count - 1);
  float shrink = exp2(-float(level)), less = 0.5 * (shrink * shrink - 1.0);
  vec3 q = vec3(xx, xy, yy) * shrink * shrink + vec3(less, 0.0, less);
  float lacks = level == 0 ? 0.0 : max(kMinVariance - (mean - away) * shrink * shrink - less, 0.0);
  q.xz += lacks;
  int face = 2 * axis + (sign < 0.0 ? 1 : 0);
  return integrate((at * scale + 0.5 * float(u_levels[0].z)) * shrink, q, 1.0, face, u_levels[level],
                   1.0 / vec2(textureSize(u_pyramid, 0).xy));
}
`;

const kFrame = `
vec3 horizontal(vec3 d) { return dot(d.xz, d.xz) > 1e-12 ? normalize(vec3(d.z, 0.0, -d.x)) : vec3(1.0, 0.0, 0.0); }
vec3 direction_at(vec2 pixel, vec2 size) {
  float lon = 2.0 * kPi * (pixel.x / size.x - 0.5), down = kPi * pixel.y / size.y;
  return vec3(sin(down) * sin(lon), -cos(down), sin(down) * cos(lon));
}
`;

/** A map of the light of round bundles of one width, u_variance. */
export const kBlurFaces = `${kHead}
${kPi}${kFrame}${kNarrow}
uniform vec2 u_size;
uniform float u_variance;
out vec4 o_light;
void main() {
  vec3 d = direction_at(gl_FragCoord.xy, u_size), e1 = horizontal(d);
  o_light = vec4(narrow(d, e1, cross(d, e1), vec3(u_variance, u_variance, 0.0)), 1.0);
}`;

/** The same for twice the width of another such map, u_width (rad). */
export const kBlurTwice = `${kHead}
${kPi}${kFrame}
uniform sampler2D u_map;
uniform float u_width;
out vec4 o_light;
void main() {
  vec3 d = direction_at(gl_FragCoord.xy, vec2(textureSize(u_map, 0))), e1 = horizontal(d), e2 = cross(d, e1);
  vec4 sum = vec4(0.0);
  for (int s = 0; s < 81; ++s) {
    vec2 off = u_width * (vec2(s % 9, s / 9) - 4.0);
    float angle = length(off);
    vec3 across = angle > 0.0 ? (off.x * e1 + off.y * e2) / angle : e1;
    float weight = exp(-0.5 * angle * angle / (3.0 * u_width * u_width));
    sum += weight * vec4(textureLod(u_map, on_map(cos(angle) * d + sin(angle) * across), 0.0).rgb, 1.0);
  }
  o_light = vec4(sum.rgb / sum.w, 1.0);
}`;

/** The mean of such a map, which is smooth. */
export const kMean = `${kHead}
${kPi}${kFrame}
uniform sampler2D u_map;
out vec4 o_light;
void main() {
  vec4 sum = vec4(0.0);
  for (int s = 0; s < 128; ++s) {
    vec2 at = (vec2(s % 16, s / 16) + 0.5) / vec2(16.0, 8.0);
    sum += sin(kPi * at.y) * vec4(textureLod(u_map, at, 0.0).rgb, 1.0);
  }
  o_light = vec4(sum.rgb / sum.w, 1.0);
}`;

/** The composite in an environment. */
export const surrounded = (wideCount: number): string => `${kHead}
${kPi}${kFrame}${kNarrow}
uniform sampler2DArray u_wide;  // maps, each of twice the width of the one before; the last is the mean
uniform float u_first_width;
uniform vec2 u_turn;  // cosine and sine
uniform float u_light;  // factor on the environment's

// The mean along the wider axis of round bundles as wide as the other axis.
vec3 wide(vec3 d, vec3 e1, vec3 e2, vec3 c) {
  float mean = 0.5 * (c.x + c.y), half_away = 0.5 * (c.x - c.y), away = length(vec2(half_away, c.z));
  float turn = 0.5 * atan(c.z, half_away), first = u_first_width * u_first_width;
  vec3 axis = cos(turn) * e1 + sin(turn) * e2;
  float low = max(mean - away, first), spread = sqrt(max(mean + away - low, 0.0));
  float level = clamp(floor(0.5 * log2(low / first)), 0.0, ${(wideCount - 2).toFixed(1)});
  float before = first * exp2(2.0 * level), share = clamp((low - before) / (3.0 * before), 0.0, 1.0);
  float step = max(sqrt(low), 0.3 * spread);
  int count = int(ceil(2.5 * spread / step - 0.1));
  vec4 sum = vec4(0.0);
  for (int i = -count; i <= count; ++i) {
    float angle = float(i) * step;
    vec2 at = on_map(cos(angle) * d + sin(angle) * axis);
    vec3 light = mix(textureLod(u_wide, vec3(at, level), 0.0).rgb, textureLod(u_wide, vec3(at, level + 1.0), 0.0).rgb, share);
    float weight = count == 0 ? 1.0 : exp(-0.5 * angle * angle / (spread * spread));
    sum += weight * vec4(light, 1.0);
  }
  return sum.rgb / sum.w;
}

vec3 turned(vec3 d) { return vec3(u_turn.x * d.x - u_turn.y * d.z, d.y, u_turn.y * d.x + u_turn.x * d.z); }

vec3 seen(uvec4 one, uvec4 two) {
  vec3 d = turned(uintBitsToFloat(one.xyz)), e1 = horizontal(d), e2 = cross(d, e1);
  vec3 c = vec3(uintBitsToFloat(one.w), uintBitsToFloat(two.x), uintBitsToFloat(two.w));
  const float kMaxNarrow = 0.0349;  // rad, as in core/rays/surroundings.h
  return u_light * (c.x + c.y > kMaxNarrow * kMaxNarrow ? wide(d, e1, e2, c) : narrow(d, e1, e2, c));
}
${kComposite}`;
