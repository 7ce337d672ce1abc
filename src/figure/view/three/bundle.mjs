// Bundles what the page uses of three.js, and notes the hash that the tests of the program compare.
import { readFileSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const outfile = "three.min.js";
await build({ entryPoints: ["entry.js"], bundle: true, minify: true, format: "iife", globalName: "THREE", target: "es2020", legalComments: "inline", outfile });

// FNV-1a of 64 bits.
let hash = 0xcbf29ce484222325n;
for (const byte of readFileSync(outfile)) hash = BigInt.asUintN(64, (hash ^ BigInt(byte)) * 0x100000001b3n);
writeFileSync(`${outfile}.fnv1a`, `${hash.toString(16).padStart(16, "0")}\n`);
