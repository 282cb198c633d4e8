"use strict";
// A worker, which runs the calls of a module one after another. The first message has the module
// and its setup; later ones are calls: { id, call, numbers, rest }.
let module = null;
let setup = null;
let api = null;

function writeNumbers(numbers) {
  const address = api.input(numbers.length);
  new Float64Array(api.memory.buffer, address, numbers.length).set(numbers);
}

async function startModule() {
  const instance = await WebAssembly.instantiate(module, {});
  api = instance.exports;
  writeNumbers(setup);
  if (api.setup() !== 1) throw new Error("the module refuses its setup");
}

async function answerCall({ id, call, numbers, rest = [] }) {
  try {
    if (!api) await startModule();
    const startMs = performance.now();
    writeNumbers(numbers);
    const count = api[call](...rest);
    const ms = performance.now() - startMs;
    const result = new Float64Array(api.memory.buffer, api.output(), count).slice();
    postMessage({ id, result, ms }, [result.buffer]);
  } catch (error) {
    // After a trap the module is instantiated anew.
    api = null;
    postMessage({ id, error: String(error) });
  }
}

onmessage = async ({ data }) => {
  if (data.call) {
    await answerCall(data);
    return;
  }
  ({ module, setup } = data);
  try {
    await startModule();
    postMessage({ ready: true, lanes: api.lanes() });
  } catch (error) {
    postMessage({ ready: false, error: String(error) });
  }
};
