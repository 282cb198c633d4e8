// A pool of workers, each with an instance of the module, and the queue of their tasks.

// Maximum number of workers, from the browser's number of processors.
const MAX_WORKERS = 8;
// Time after its start from which a cancelled task is aborted, ms.
const ABORT_DELAY_MS = 60;

// `module` is a promise of the bytes of the module. `report` is called with
// { workers, ready, lanes, error } when workers start.
function createPool(module, setup, report) {
  const source = document.getElementById("worker").textContent;
  const url = URL.createObjectURL(new Blob([source], { type: "text/javascript" }));
  const workerCount = Math.min(Math.max(navigator.hardwareConcurrency || 2, 2), MAX_WORKERS);
  const state = { workers: workerCount, ready: 0, lanes: 0, error: null };
  const members = [];
  let queue = [];
  let nextId = 0;
  let readyModule = null;

  function reportFailure(error) {
    state.error = error;
    report(state);
  }

  function startWorker(member) {
    member.worker = new Worker(url);
    member.task = null;
    member.isReady = false;
    member.worker.onmessage = ({ data }) => {
      if (data.ready !== undefined) {
        member.isReady = data.ready;
        state.ready = members.filter((other) => other.isReady).length;
        if (data.ready) state.lanes = data.lanes;
        else state.error = data.error;
        report(state);
      } else if (member.task?.id === data.id) {
        const { task } = member;
        member.task = null;
        if (data.error) task.reject(new Error(data.error));
        else task.resolve({ numbers: data.result, ms: data.ms });
      }
      assignTasks();
    };
    member.worker.onerror = (event) => reportFailure(event.message || "a worker did not start");
    member.worker.postMessage({ module: readyModule, setup });
  }

  function assignTasks() {
    for (const member of members) {
      if (!member.isReady || member.task || queue.length === 0) continue;
      // The most urgent call comes first, and among equally urgent ones the oldest.
      queue.sort((a, b) => b.urgency - a.urgency || a.id - b.id);
      const task = queue.shift();
      member.task = task;
      task.startMs = performance.now();
      const { id, call, numbers, rest } = task;
      member.worker.postMessage({ id, call, numbers, rest });
    }
  }

  // Queues a call of the module and returns a promise of { numbers, ms }. `cancel` identifies calls
  // by `kind`.
  function request(kind, urgency, call, numbers, rest = []) {
    return new Promise((resolve, reject) => {
      nextId += 1;
      queue.push({ id: nextId, kind, urgency, call, numbers, rest, resolve, reject });
      assignTasks();
    });
  }

  // Cancels all calls of a kind, also those that a worker executes.
  function cancel(kind) {
    const isCancelled = (task) => task.kind === kind;
    for (const task of queue.filter(isCancelled)) task.reject(null);
    queue = queue.filter((task) => !isCancelled(task));
    for (const member of members) {
      const { task } = member;
      if (!task || !isCancelled(task)) continue;
      setTimeout(() => {
        if (member.task !== task) return;
        member.worker.terminate();
        task.reject(null);
        startWorker(member);
      }, Math.max(0, ABORT_DELAY_MS - (performance.now() - task.startMs)));
    }
  }

  module.then((bytes) => WebAssembly.compile(bytes)).then((compiledModule) => {
    readyModule = compiledModule;
    for (let k = 0; k < workerCount; k++) {
      members.push({});
      startWorker(members[k]);
    }
  }, (error) => reportFailure(String(error)));
  return { request, cancel };
}
