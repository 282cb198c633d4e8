// The pool of workers that compute, each with the module; a queue feeds them.

// Maximum number of workers, from the browser's number of processors.
const MOST_WORKERS = 8;
// Time after which work that was dropped is cut off, ms.
const PATIENCE = 60;

// `module` is a promise of its bytes. `tell` is called with { workers, ready, lanes, error } as
// workers start.
function createPool(module, setup, tell) {
  const source = document.getElementById("worker").textContent;
  const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
  const count = Math.min(Math.max(navigator.hardwareConcurrency || 2, 2), MOST_WORKERS);
  const state = { workers: count, ready: 0, lanes: 0, error: null };
  const members = [];
  let queue = [];
  let next = 0;
  let compiled = null;

  function failed(error) {
    state.error = error;
    tell(state);
  }

  function hire(member) {
    member.worker = new Worker(url);
    member.task = null;
    member.isReady = false;
    member.worker.onmessage = ({ data }) => {
      if (data.ready !== undefined) {
        member.isReady = data.ready;
        state.ready = members.filter((one) => one.isReady).length;
        if (data.ready) state.lanes = data.lanes;
        else state.error = data.error;
        tell(state);
      } else if (member.task?.id === data.id) {
        const { task } = member;
        member.task = null;
        if (data.error) task.fail(new Error(data.error));
        else task.done({ numbers: data.found, ms: data.ms });
      }
      feed();
    };
    member.worker.onerror = (event) => failed(event.message || "a worker did not start");
    member.worker.postMessage({ module: compiled, setup });
  }

  function feed() {
    for (const member of members) {
      if (!member.isReady || member.task || queue.length === 0) continue;
      // The most urgent call comes first; of equally urgent ones, the oldest.
      queue.sort((a, b) => b.urgency - a.urgency || a.id - b.id);
      const task = queue.shift();
      member.task = task;
      task.started = performance.now();
      const { id, call, numbers, rest } = task;
      member.worker.postMessage({ id, call, numbers, rest });
    }
  }

  // Calls the module and returns a promise of { numbers, ms }. `drop` refers to calls by `kind`.
  function ask(kind, urgency, call, numbers, rest = []) {
    return new Promise((done, fail) => {
      next += 1;
      queue.push({ id: next, kind, urgency, call, numbers, rest, done, fail });
      feed();
    });
  }

  // Drops calls that are not needed any more, even if a worker is on them.
  function drop(kind) {
    const isDropped = (task) => task.kind === kind;
    for (const task of queue.filter(isDropped)) task.fail(null);
    queue = queue.filter((task) => !isDropped(task));
    for (const member of members) {
      const { task } = member;
      if (!task || !isDropped(task)) continue;
      setTimeout(() => {
        if (member.task !== task) return;
        member.worker.terminate();
        task.fail(null);
        hire(member);
      }, Math.max(0, PATIENCE - (performance.now() - task.started)));
    }
  }

  module.then((bytes) => WebAssembly.compile(bytes)).then((ready) => {
    compiled = ready;
    for (let k = 0; k < count; k++) {
      members.push({});
      hire(members[k]);
    }
  }, (error) => failed(String(error)));
  return { ask, drop };
}
