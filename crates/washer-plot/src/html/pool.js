// Workers that compute, each with the module; a queue feeds them.

// Most workers, of the processors that the browser tells of.
const MOST_WORKERS = 8;
// Work on something that is not wanted any more is cut off after this time, ms.
const PATIENCE = 60;

// `module` is a promise of its bytes. `tell` hears { workers, ready, lanes, error } as workers come
// up.
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
      // The most urgent first, of equals the oldest.
      queue.sort((a, b) => b.urgency - a.urgency || a.id - b.id);
      const task = queue.shift();
      member.task = task;
      task.started = performance.now();
      const { id, call, numbers, rest } = task;
      member.worker.postMessage({ id, call, numbers, rest });
    }
  }

  // A call to the module, as a promise of { numbers, ms }. `kind` is what `drop` knows it by.
  function ask(kind, urgency, call, numbers, rest = []) {
    return new Promise((done, fail) => {
      next += 1;
      queue.push({ id: next, kind, urgency, call, numbers, rest, done, fail });
      feed();
    });
  }

  // Lets go of what is not wanted any more, also where it is being worked on.
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
