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

// Sums of differences of the bits of float32, as packing.py writes them: the lowest bytes of all first.
async function unpacked(text) {
  const bytes = await inflated(text), count = bytes.length / 4, bits = new Uint32Array(count);
  for (let i = 0, sum = 0; i < count; i++) {
    sum += bytes[i] + 256 * bytes[count + i] + 65536 * bytes[2 * count + i] + 16777216 * bytes[3 * count + i];
    bits[i] = sum >>>= 0;
  }
  return new Float32Array(bits.buffer);
}

// Run a script of the page itself: the policy lets none come from elsewhere.
async function run(id) {
  const script = document.createElement("script");
  script.textContent = new TextDecoder().decode(await inflated(document.getElementById(id).textContent));
  document.head.append(script);
}
