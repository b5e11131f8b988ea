// Reads the tensors that a page holds: base64 of a zlib stream of a safetensors file.

const TYPES = { F32: Float32Array, F16: Uint16Array, I32: Int32Array, U8: Uint8Array };

/**
 * Unpacks tensors without a fetch, which pages opened as files may not do.
 *
 * @param {string} text base64.
 * @throws {Error} where that is not possible.
 * @returns {Promise<{tensors: Map<string, {shape: number[], data: ArrayLike<number>}>, metadata: object}>}
 */
export async function unpack(text) {
  try {
    const packed = Uint8Array.from(atob(text), (character) => character.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    return readTensors(await new Response(stream).arrayBuffer());
  } catch (error) {
    const help = "update the browser, or copy the page again";
    throw new Error(`The scene in this page cannot be unpacked (${error.message}): ${help}.`);
  }
}

/** The tensors of a safetensors file; half precision becomes single. */
export function readTensors(buffer) {
  const length = Number(new DataView(buffer).getBigUint64(0, true));
  const header = new TextDecoder().decode(new Uint8Array(buffer, 8, length));
  const { __metadata__: metadata, ...entries } = JSON.parse(header);
  const tensors = new Map();
  for (const [name, { dtype, shape, data_offsets: [begin, end] }] of Object.entries(entries)) {
    const data = new TYPES[dtype](buffer.slice(8 + length + begin, 8 + length + end));
    tensors.set(name, { shape, data: dtype === "F16" ? Float32Array.from(data, halfToFloat) : data });
  }
  return { tensors, metadata };
}

/** Rows of whole numbers from their bytes [B, C, N], see codes_of in texgs/fields/surfels/compact.py. */
export function wholeNumbers({ shape: [planes, rows, count], data }) {
  return Array.from({ length: rows }, (_, row) => {
    const numbers = new Int32Array(count);
    for (let i = 0; i < count; i++) {
      let signed = 0;
      for (let k = 0; k < planes; k++) signed |= data[(rows * k + row) * count + i] << (8 * k);
      numbers[i] = (signed >>> 1) ^ -(signed & 1);
    }
    return numbers;
  });
}

/** The number that 16 bits of IEEE 754 half precision mean. */
export function halfToFloat(bits) {
  const sign = bits & 0x8000 ? -1 : 1;
  const exponent = (bits >> 10) & 31;
  const fraction = bits & 1023;
  if (exponent === 0) return sign * fraction * 2 ** -24;
  if (exponent === 31) return fraction ? NaN : sign * Infinity;
  return sign * (1024 + fraction) * 2 ** (exponent - 25);
}
