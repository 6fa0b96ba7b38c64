/* Data of the page: compressed blocks, decoded when they come into view. */
"use strict";
const page = {
  css: (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim(),
  redraws: [],  // called when colours change

  /* See blocks.py for the format. */
  async decoded(text) {
    const packed = Uint8Array.from(atob(text.trim()), (c) => c.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const raw = new Uint8Array(await new Response(stream).arrayBuffer());
    const length = new DataView(raw.buffer).getUint32(0, true);
    const data = JSON.parse(new TextDecoder().decode(raw.subarray(4, 4 + length)));
    let at = 4 + length;
    for (const [name, { count, low, step }] of Object.entries(data.arrays)) {
      const values = new Float32Array(count);
      for (let i = 0, level = 0; i < count; i++) {
        level = (level + raw[at + i] + 256 * raw[at + count + i]) & 65535;
        values[i] = low + step * level;
      }
      data.arrays[name] = values;
      at += 2 * count;
    }
    return data;
  },

  /* The drawing of a helmet, which impacts share: corners and triangles, decoded once. */
  meshes: {},
  mesh(key) {
    return this.meshes[key] ||= (async () => {
      const { vertices, faces } = (await this.decoded(document.querySelector(`script[data-mesh="${key}"]`).textContent)).arrays;
      const rows = (values, at) => {
        const count = values.length / 3;
        return Array.from({ length: count }, (_, i) => [at(values[i]), at(values[count + i]), at(values[2 * count + i])]);
      };
      return { vertices: rows(vertices, (v) => v), faces: rows(faces, Math.round) };
    })();
  },

  times(data) {
    return Float64Array.from({ length: data.count }, (_, i) => data.start + i * data.step);
  },
};
