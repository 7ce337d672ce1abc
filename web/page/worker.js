// The solver, beside the page: it gets questions, and gives answers, one after the other.
let module = null;
let solver = null;

const host = { seconds: () => performance.now() / 1000 };

async function start() {
  solver = (await WebAssembly.instantiate(module, { host })).exports;
}

function answer(question) {
  const bytes = new TextEncoder().encode(JSON.stringify(question));
  const place = solver.place(bytes.length);
  new Uint8Array(solver.memory.buffer, place, bytes.length).set(bytes);
  const length = solver.answer();
  const result = new Uint8Array(solver.memory.buffer, solver.result(), length);
  return JSON.parse(new TextDecoder().decode(result));
}

self.onmessage = async ({ data: { id, question, code } }) => {
  try {
    if (code) {
      module = code;
      await start();
      self.postMessage({ id, answer: { answer: "ready" } });
      return;
    }
    const before = performance.now();
    const given = answer(question);
    self.postMessage({ id, answer: given, took: performance.now() - before });
  } catch (reason) {
    // It is in an unknown state: the next question finds a new one.
    await start();
    self.postMessage({ id, answer: { answer: "lost", error: `the solver broke off (${reason.message}): the scenario is opened again` } });
  }
};
