// The arrays of the file: base64, then zlib, then the filters of pdvol/studio/play/packing.py. Positions stay whole numbers of
// 16 bits, four to a vertex (the last one unused: graphics cards want rows of whole words).
"use strict";

const DATA = JSON.parse(document.getElementById("data").textContent);

async function inflated(chunk) {
  const text = atob(chunk), packed = new Uint8Array(text.length);
  for (let i = 0; i < text.length; i++) packed[i] = text.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// (states, points, components) of a filtered chunk, padded to `width` components.
function unfiltered(bytes, entry, width) {
  const [states, points, components] = entry.shape;
  const wide = entry.type === "uint16", plane = states * points;
  const values = wide ? new Uint16Array(plane * width) : new Uint8Array(plane * width);
  const twice = entry.filter === "2";
  for (let c = 0; c < components; c++) {
    const low = c * plane * (wide ? 2 : 1), high = low + plane;
    for (let i = 0; i < points; i++) {
      let value = 0, velocity = 0;
      for (let s = 0, at = i; s < states; s++, at += points) {
        const folded = wide ? bytes[low + at] | (bytes[high + at] << 8) : bytes[low + at];
        const residual = (folded >>> 1) ^ -(folded & 1);
        velocity = twice && s > 1 ? velocity + residual : residual;
        value += velocity;
        values[at * width + c] = value;  // modulo 2^bits
      }
    }
  }
  return values;
}

// Values of all states: `at` gives those of one, four numbers a vertex where they are positions.
class States {
  constructor(values, states, points) { Object.assign(this, { values, states, points, width: values.length / (states * points) }); }
  at(state) { return this.values.subarray(state * this.points * this.width, (state + 1) * this.points * this.width); }
}

const KINDS = { uint8: Uint8Array, uint16: Uint16Array, uint32: Uint32Array, float32: Float32Array };

async function textured(bytes) {
  const image = await createImageBitmap(new Blob([bytes]), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
  const map = Object.assign(new THREE.Texture(image), { flipY: false, anisotropy: 4, needsUpdate: true });
  map.wrapS = map.wrapT = THREE.RepeatWrapping;
  return map;
}

// All arrays of a file by number: `States`; of raw ones `values` alone, of pictures { map }.
async function unpacked(entries, textOf) {
  const found = [];
  for (const [number, entry] of entries.entries()) {
    const bytes = await inflated(textOf(number)), [states, points, components] = entry.shape;
    if (entry.filter === "raw") {
      found.push(new States(new KINDS[entry.type](bytes.buffer), states, points));
    } else if (entry.filter === "picture") {
      found.push({ map: await textured(bytes) });
    } else {
      found.push(new States(unfiltered(bytes, entry, components > 1 ? 4 : 1), states, points));
    }
  }
  return found;
}
