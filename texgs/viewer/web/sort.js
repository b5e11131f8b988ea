// The order in which surfels are blended: by the depth of their means, far to near, exactly.

const BITS = 11;
const BUCKETS = 1 << BITS;

/** Sorts up to `capacity` surfels by 32-bit depth, without garbage from frame to frame. */
export class DepthOrder {
  constructor(capacity) {
    this.depths = new Float32Array(capacity); // of the surfels that were added, in the order of adding
    this.surfels = new Uint32Array(capacity);
    this.count = 0;
    this._bits = new Uint32Array(this.depths.buffer);
    this._keys = [new Uint32Array(capacity), new Uint32Array(capacity)];
    this._order = [new Uint32Array(capacity), new Uint32Array(capacity)];
    this._starts = new Uint32Array(BUCKETS);
  }

  clear() {
    this.count = 0;
  }

  /** Adds a surfel at a depth, which is above 0. */
  add(surfel, depth) {
    this.depths[this.count] = depth;
    this.surfels[this.count++] = surfel;
  }

  /**
   * The surfels from far to near. Of equal depths the one that was added last comes first: this is the reverse
   * of the rasterizer's order, which is near to far and stable.
   *
   * @returns {Uint32Array} valid until the next sort; `latest`, too.
   */
  farToNear() {
    const last = this.count - 1;
    for (let i = 0; i <= last; i++) {
      this._keys[0][i] = ~this._bits[last - i]; // positive floats sort as their bits do
      this._order[0][i] = this.surfels[last - i];
    }
    for (let pass = 0; pass < 3; pass++) this._scatter(pass & 1, pass * BITS);
    return this.latest = this._order[1].subarray(0, this.count);
  }

  /** One stable pass of a radix sort by the bits from `shift`, out of buffer `from` into the other one. */
  _scatter(from, shift) {
    const [keys, order] = [this._keys[from], this._order[from]];
    const [toKeys, toOrder] = [this._keys[1 - from], this._order[1 - from]];
    const starts = this._starts.fill(0);
    for (let i = 0; i < this.count; i++) starts[(keys[i] >>> shift) & (BUCKETS - 1)]++;
    for (let bucket = 0, start = 0; bucket < BUCKETS; bucket++) {
      const size = starts[bucket];
      starts[bucket] = start;
      start += size;
    }
    for (let i = 0; i < this.count; i++) {
      const place = starts[(keys[i] >>> shift) & (BUCKETS - 1)]++;
      toKeys[place] = keys[i];
      toOrder[place] = order[i];
    }
  }
}
