// The address that holds scenario and view: `#s=`, compressed; and what is saved.

const letters = (bytes) => btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join("")).replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "");
const bytesOfLetters = (text) => bytesOf(text.replaceAll("-", "+").replaceAll("_", "/"));

async function packed(object) {
  return letters(await through(new TextEncoder().encode(JSON.stringify(object)), new CompressionStream("deflate-raw")));
}

/// What an address holds, if it is one of this page.
async function unpacked(hash) {
  const found = /^#s=([\w-]+)$/.exec(hash);
  if (!found) return null;
  const text = new TextDecoder().decode(await through(bytesOfLetters(found[1]), new DecompressionStream("deflate-raw")));
  const { text: scenario, name, values, sliders: shown, last, view, looks, at } = JSON.parse(text);
  if (typeof scenario !== "string") return null;
  const number = ([key, value]) => typeof key === "string" && Number.isFinite(value);
  return {
    text: scenario,
    name: String(name || "shared.toml"),
    values: Array.isArray(values) ? values.filter(number) : [],
    sliders: Array.isArray(shown) ? shown.map(({ key, low, high, log }) => ({ key, low: Number(low), high: Number(high), log: Boolean(log) })).filter(({ low, high, log }) => low < high && (!log || low > 0)) : [],
    last: typeof last === "string" ? last : null,
    view: Array.isArray(view) && [4, 13].includes(view.length) && view.every(Number.isFinite) && Math.hypot(...view.slice(0, 3)) > 0.5 && view[3] > 0 && view.slice(7, 10).every((low, k) => low <= view[10 + k]) ? view : null,
    looks: looks && typeof looks === "object" ? looks : {},
    at: typeof at === "string" ? at : null,
  };
}

function download(name, blob) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}
