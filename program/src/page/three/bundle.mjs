// Bundles what the page uses of three.js, and notes the checksum that the tests of the program compare.
import { readFileSync, writeFileSync } from "node:fs";
import { crc32 } from "node:zlib";
import { build } from "esbuild";

const outfile = "three.min.js";
await build({ entryPoints: ["entry.js"], bundle: true, minify: true, format: "iife", globalName: "THREE", target: "es2020", legalComments: "inline", outfile });

writeFileSync(`${outfile}.crc32`, `${crc32(readFileSync(outfile)).toString(16).padStart(8, "0")}\n`);
