// Reads a rosbag2 with Foxglove's reader and says in JSON what is in it: counts, stamps, and each packed depth image unpacked by a decoder of its own.
const fs = require('fs');
const path = require('path');
global.File = global.File || class File {};
const { Rosbag2, SqliteSqljs } = require('@foxglove/rosbag2-web');

// RVL from its description (Wilson 2017), written for this test alone.
function unpack(bytes, pixels) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  let at = 0, word = 0, left = 0, last = 0;
  const number = () => {
    let value = 0, shift = 0;
    for (;;) {
      if (left === 0) { word = view.getUint32(at, true); at += 4; left = 8; }
      const nibble = word >>> 28;
      word = (word << 4) >>> 0;
      --left;
      value |= (nibble & 7) << shift;
      if (nibble < 8) return value >>> 0;
      shift += 3;
    }
  };
  const out = new Uint16Array(pixels);
  for (let i = 0; i < pixels;) {
    i += number();
    for (let n = number(); n > 0; --n) {
      const code = number();
      last += (code >>> 1) ^ -(code & 1);
      out[i++] = last;
    }
  }
  return out;
}

async function main() {
  const folder = process.argv[2];
  // By itself it would fetch its WebAssembly as a page does.
  await SqliteSqljs.Initialize({ wasmBinary: fs.readFileSync(require.resolve('@foxglove/sql.js/dist/sql-wasm.wasm')) });
  const file = fs.readdirSync(folder).find((name) => name.endsWith('.db3'));
  const bag = new Rosbag2([new SqliteSqljs(new Uint8Array(fs.readFileSync(path.join(folder, file))))]);
  await bag.open();
  const result = { topics: {}, images: 0, pixels: 0, measured: 0, sum: 0, format: '', events: 0, camera_info: null };
  for (const topic of await bag.readTopics()) result.topics[topic.name] = topic.type;
  for await (const message of bag.readMessages()) {
    const value = message.value;
    const name = message.topic.name;
    if (name.endsWith('/camera_info')) result.camera_info = { width: value.width, height: value.height, k: Array.from(value.k ?? value.K) };
    if (name === '/booth/event') { JSON.parse(value.data); ++result.events; }
    let depth = null;
    if (name.endsWith('/compressedDepth')) {
      result.format = value.format;
      const head = new DataView(value.data.buffer, value.data.byteOffset, 20);
      const width = head.getUint32(12, true), height = head.getUint32(16, true);
      depth = unpack(value.data.slice(20), width * height);
    } else if (name.endsWith('/image_raw')) {
      result.format = value.encoding;
      depth = new Uint16Array(value.data.slice().buffer);
    }
    if (depth === null) continue;
    ++result.images;
    result.pixels += depth.length;
    for (const d of depth) if (d > 0) { ++result.measured; result.sum += d; }
  }
  console.log(JSON.stringify(result));
}
main().catch((error) => { console.error(String(error.stack || error)); process.exit(1); });
