/** Linear light of an sRGB code, both 0 to 1 (IEC 61966-2-1). */
export function lightOf(code: number): number {
  return code <= 0.04045 ? code / 12.92 : ((code + 0.055) / 1.055) ** 2.4;
}

/** The sRGB code of linear light, both 0 to 1. */
export function codeOf(light: number): number {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * light ** (1 / 2.4) - 0.055;
}
