// Questions to the solver, which has a thread of its own.

/// A solver in a thread; `ask` gives a promise of the answer.
class Solver {
  constructor(source, code) {
    Object.assign(this, { source, code });
    this.waiting = new Map();
    this.count = 0;
    this.worker = new Worker(source);
    this.worker.onmessage = ({ data }) => {
      const settle = this.waiting.get(data.id);
      this.waiting.delete(data.id);
      this.took = data.took;
      settle(data.answer);
    };
    this.ready = this.post({ code });
  }

  post(message) {
    const id = this.count++;
    return new Promise((settle) => {
      this.waiting.set(id, settle);
      this.worker.postMessage({ id, ...message });
    });
  }

  /// One that is free: another, where this is still at something that nobody waits for any more.
  free() {
    if (this.waiting.size === 0) return this;
    this.worker.terminate();
    for (const settle of this.waiting.values()) settle({ answer: "gone" });
    return new Solver(this.source, this.code);
  }

  ask(question) {
    return this.post({ question });
  }
}

const bytesOf = (base64) => Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));

/// What a stream makes of bytes.
async function through(bytes, stream) {
  return new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());
}

/// The code of the solver.
const code = async () => WebAssembly.compile(await unpack("solver"));
