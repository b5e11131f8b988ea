// The samples of a volume in a page: codes of values, packed as differences along all axes.

/**
 * Codes [Z, Y, X] of each channel from unpacked tensors, see texgs/viewer/page_volume.py.
 *
 * @param {Map<string, {shape: number[], data: Uint8Array}>} tensors
 * @param {number} count of channels.
 * @returns {{channels: Uint8Array[], sizes: number[]}} sizes x, y, z.
 */
export function samplesOf(tensors, count) {
  const { shape: [nz, ny, nx], data: codes } = tensors.get("steps"), plane = ny * nx;
  for (let i = plane; i < codes.length; i++) codes[i] += codes[i - plane];
  for (let i = 0; i < codes.length; i++) if (i % plane >= nx) codes[i] += codes[i - nx];
  for (let i = 0; i < codes.length; i++) if (i % nx) codes[i] += codes[i - 1];
  const size = codes.length / count, channels = Array.from({ length: count }, (_, c) => codes.subarray(c * size, (c + 1) * size));
  return { channels, sizes: [nx, ny, nz / count] };
}
