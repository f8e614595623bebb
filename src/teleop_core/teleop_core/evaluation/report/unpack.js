// Unpack: numbers and texts that the page holds as base64 of a raw deflate stream.

async function inflated(text) {
  if (!text) return new Uint8Array(0);
  if (typeof DecompressionStream === "undefined")
    throw new Error("this browser cannot unpack the plots; one of 2023 or later can");
  const packed = atob(text), bytes = new Uint8Array(packed.length);
  for (let i = 0; i < packed.length; i++) bytes[i] = packed.charCodeAt(i);
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate-raw"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

// Sums of differences, as packing.py writes them: the lowest bytes of all first, the sign in the
// lowest bit, holes as bits. A few numbers come as they are.
async function unpacked({ count, first, step, order, planes, data, holes, wide }) {
  const bytes = await inflated(data);
  if (order === 0) return new Float64Array(bytes.buffer, 0, count);
  const numbers = wide ? new Float64Array(count) : new Float32Array(count);
  for (let i = 0, level = 0, change = 0; i < count; i++) {
    let code = 0;
    for (let plane = planes - 1; plane >= 0; plane--) code = 256 * code + bytes[plane * count + i];
    const difference = code % 2 ? -(code + 1) / 2 : code / 2;
    change = order === 2 ? change + difference : difference;
    level += change;
    numbers[i] = first + step * level;
  }
  if (!holes) return numbers;
  const bits = await inflated(holes);
  for (let i = 0; i < count; i++) if ((bits[i >> 3] >> (i & 7)) & 1) numbers[i] = NaN;
  return numbers;
}

// Run a script of the page itself: the policy lets none come from elsewhere.
async function run(id) {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflated(document.getElementById(id).textContent));
  document.head.append(script);
}
