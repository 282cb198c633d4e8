// The live panel: sliders, both models' peaks and curves at any point, a finer map.

// An index beyond all refinement levels, for which the module uses the quick level.
const QUICK_LEVEL = 255;
// Time without a change of the sliders after which their point is checked, ms.
const REST_MS = 150;
const FAILURE_WORDS = ["", "diverged", "needs steps too small", "used up its steps"];
// The size of a finer map: points along each axis, cells of the map that it spans without a zoom,
// points in a call.
const FINE_MAP = { points: 20, cells: 7, batchSize: 10 };

function createLive(host, data) {
  const { live } = data;
  const values = live.sliders.map((slider) => slider.value);
  let map = null;
  let latestRevision = 0;
  let restTimer = 0;
  let isBusy = false;
  let hasMoved = false;
  let fineCells = [];
  let fineRemaining = 0;
  // Returns the ends of a slider along both axes, as the map spaces them.
  let fineEdges = null;

  const find = appendTemplate(host, "live");
  const [panel, status, resetButton, refineButton, valuesHost, chartHost] = ["#live",
    "#live-status", "#live-reset", "#refine", "#live-values", "#live-charts"].map(find);
  const inputs = live.sliders.map((slider, k) => createSlider(slider, k));
  find(".sliders").append(...inputs.map((input) => input.row));
  values.forEach((value, k) => setValue(k, value));
  resetButton.addEventListener("click", () => {
    setSliders(live.sliders.flatMap(({ axis, value }, k) => (axis ? [] : [[k, value]])));
  });
  refineButton.addEventListener("click", refineMap);
  const texts = { ...live, window: live.windowS.join(" to ") };
  for (const note of panel.querySelectorAll("[data-said]")) {
    note.textContent = texts[note.dataset.said];
  }
  panel.querySelectorAll("#computed-with ul").forEach((list, model) => {
    list.append(...live.rungs[model].map((text) => element("li", {}, text)));
  });

  const pool = createPool(unpackGzip(live.module), decodeDoubles(live.setup), (state) => {
    if (state.error) status.textContent = `This browser cannot compute here: ${state.error}.`;
    panel.dataset.ready = `${state.ready} of ${state.workers}`;
    find("#live-workers").textContent = `${state.ready} workers, each with a module `
      + `of its own: WebAssembly with simd128, ${state.lanes} trajectories side by side.`;
  });
  const curves = createCurves(chartHost, live);
  const growth = live.kinds.length > 0 ? createGrowth(chartHost, live, pool) : null;

  function createSlider(slider, k) {
    const { from, to } = slider;
    // The slider of a logarithmic axis moves by the logarithm and shows the value.
    const [toScale, fromScale] = slider.log ? [Math.log10, (x) => 10 ** x] : [(x) => x, (x) => x];
    const clampToRange = (value) => Math.min(Math.max(value, from), to);
    const number = element("input", {
      type: "number", step: "any", min: from, max: to,
      "aria-label": withUnit(slider.words, slider.unit), "data-number": slider.name,
      onchange: () => {
        const typedValue = Number(number.value);
        setValue(k, Number.isFinite(typedValue) ? clampToRange(typedValue) : values[k]);
        updatePoint();
      },
    });
    const range = element("input", {
      type: "range", step: "any", min: toScale(from), max: toScale(to),
      "aria-label": slider.words, "data-slider": slider.name, title: slider.description,
      oninput: () => {
        setValue(k, clampToRange(Number(fromScale(Number(range.value)).toPrecision(4))));
        updatePoint();
      },
    });
    return { number, range, toScale, row: element("label", { title: slider.description },
      element("span", {}, slider.words), range, number, element("span", {}, slider.unit)) };
  }

  function setValue(k, value) {
    values[k] = value;
    const { number, range, toScale } = inputs[k];
    // A value that a step of an axis has rounded is restored.
    number.value = Number(value.toPrecision(12));
    range.value = toScale(value);
    if (live.sliders[k].log) range.setAttribute("aria-valuetext", value);
  }

  // Sets some sliders, each by its number and value.
  function setSliders(settings) {
    for (const [k, value] of settings) setValue(k, value);
    updatePoint();
  }

  function updatePoint() {
    latestRevision += 1;
    clearTimeout(restTimer);
    pool.cancel("check");
    growth?.discardPoint();
    map?.mark?.();
    if (isBusy) hasMoved = true;
    else computePreviews();
  }

  const request = (kind, urgency, call, rest) => pool
    .request(kind, urgency, call, [...values], rest);
  const requestMotions = (kind, levels) => [0, 1].map((model) => request(kind, 3, "history",
    [model, levels[model], live.everyS]));

  // Computes previews until the sliders rest, and then starts the check of the point.
  async function computePreviews() {
    isBusy = true;
    do {
      hasMoved = false;
      const startMs = performance.now();
      try {
        const speeds = request("preview", 3, "speeds", [live.everyS]);
        const [peaks, ...motions] = await Promise.all([
          request("preview", 4, "quick", [values.length]),
          ...requestMotions("preview", [QUICK_LEVEL, QUICK_LEVEL])]);
        const durationMs = performance.now() - startMs;
        const ms = [peaks, ...motions].map((result) => result.ms);
        const answer = parseAnswer(peaks.numbers, live);
        showAnswer({ ...answer, isChecked: false, elapsedMs: durationMs, ms });
        curves.show(motions.map((motion) => motion.numbers), (await speeds).numbers);
      } catch (error) {
        showError(error);
      }
    } while (hasMoved);
    isBusy = false;
    restTimer = setTimeout(() => checkPoint(latestRevision), REST_MS);
  }

  async function checkPoint(revision) {
    try {
      const startMs = performance.now();
      const { numbers, ms } = await request("check", 2, "checked");
      if (revision !== latestRevision) return;
      const answer = parseAnswer(numbers, live);
      if (answer.is !== 1) return;
      showAnswer({ ...answer, isChecked: true, elapsedMs: performance.now() - startMs, ms: [ms] });
      const speedsRequest = request("check", 2, "speeds", [live.everyS]);
      const levels = answer.records.map((record) => record.rung);
      const motions = await Promise.all(requestMotions("check", levels));
      const speeds = (await speedsRequest).numbers;
      if (revision === latestRevision) {
        curves.show(motions.map((motion) => motion.numbers), speeds);
        if (live.heldMetrics.length) showHeldMetrics(revision);
        growth?.setPoint([...values], speeds.reduce((most, speed) => Math.max(most, speed)));
      }
    } catch (error) {
      showError(error);
    }
  }

  // Shows the map's metrics at constant speeds; slow ones are computed on request.
  function showHeldMetrics(revision) {
    const paragraph = element("p", { id: "held" });
    const computeMetrics = () => Promise.all(live.heldMetrics.map(async (metric) => {
      paragraph.textContent = "Constant speeds: computing.";
      const [sentence, numbers] = await HELD_METRICS[metric](pool, [...values], live);
      paragraph.dataset[metric] = numbers.join(" ");
      return sentence;
    })).then((sentences) => {
      if (revision === latestRevision) paragraph.textContent = sentences.join(" ");
    }, showError);
    valuesHost.append(paragraph);
    if (!live.hasSlowGrowth && !live.heldMetrics.includes("dwell")) computeMetrics();
    else paragraph.append(element("button", { type: "button", onclick: computeMetrics },
      `Compute ${live.heldMetrics.join(" and ")} at ${live.heldSpeedsRpm.length} constant speeds`));
  }

  // Shows an error. A cancelled request has none.
  function showError(error) {
    if (!error) return;
    status.textContent = `This point could not be computed: ${error.message}. It is a defect.`;
  }

  const comparedRatios = (ratios) => live.compared.map((channel) => ratios[channel])
    .filter(Number.isFinite);
  const greatestOf = (ratios) => Math.max(...comparedRatios(ratios));
  const leastOf = (ratios) => Math.min(...comparedRatios(ratios));
  const isTrusted = (ratios) => greatestOf(ratios) < live.ratioLimit
    && (live.ratioMin === null || leastOf(ratios) > live.ratioMin);

  function showAnswer(answer) {
    panel.dataset.kind = answer.isChecked ? "checked" : "preview";
    panel.dataset.point = values.join(" ");
    panel.dataset.ms = answer.ms.join(" ");
    if (answer.is !== 1) {
      valuesHost.replaceChildren(element("p", { class: "verdict" }, answer.is === 0
        ? "No such machine: its numbers contradict each other."
        : "No static equilibrium: the springs cannot carry the machine."));
      status.textContent = "Nothing to compute.";
      return;
    }
    const { records, ratios } = answer;
    panel.dataset.records = records.map(({ failure, failTime, steps, gap, amplitudes, metrics }) =>
      [failure, failTime, steps, gap, ...amplitudes, ...metrics].join(" ")).join(" ");
    panel.dataset.ratios = ratios.join(" ");
    panel.dataset.sag = answer.sag;
    const greatestRatio = greatestOf(ratios);
    const channel = live.compared.find((index) => ratios[index] === greatestRatio);
    const failedModel = records.findIndex((record) => record.failure !== 0);
    const verdict = failedModel >= 0
      ? `The ${["nonlinear", "linear"][failedModel]} model `
        + `${FAILURE_WORDS[records[failedModel].failure]} at `
        + `${formatSignificant(records[failedModel].failTime)} s`
      : channel === undefined ? "Undefined: no excitation"
        : `Linear model ${isTrusted(ratios) ? "" : "un"}reliable here`;
    const createRow = (words, unit, valueOf, ratioText = "") => tableRow(withUnit(words, unit),
      [...records.map((record) => formatSignificant(valueOf(record))), ratioText]);
    const rows = live.channels.map((channel, k) => createRow(channel.words, channel.unit,
      (record) => record.amplitudes[k] * channel.factor, formatSignificant(ratios[k])));
    rows.push(createRow("Least gap, whole run", "mm", (record) => record.gap * 1e3));
    live.metrics.forEach((metric, k) => rows.push(createRow(metric.words, metric.unit,
      (record) => record.metrics[k] * metric.factor)));
    const sag = live.hasStaticSag
      ? [element("p", {}, `Static sag of the tub ${formatSignificant(answer.sag * 1e3)} mm`)] : [];
    const largestRatioText = channel !== undefined
      && `Largest ratio ${formatSignificant(greatestRatio)} (`
      + `${live.channels[channel].words}), the limit is ${live.ratioLimit}`;
    const valueTable = table(["", "nonlinear", "linear", "ratio"], rows);
    valueTable.prepend(element("caption", {},
      `${capitalise(live.criterion[0])}. Ratio: ${live.criterion[1]}.`));
    valuesHost.replaceChildren(
      element("p", { class: "kind" }, answer.isChecked ? "Checked" : "Preview, not checked"),
      element("p", { class: "verdict" }, answer.isChecked ? verdict : `${verdict}?`),
      ...(largestRatioText ? [element("p", {}, largestRatioText)] : []),
      ...(answer.sensitive ? [element("p", {}, "The motion is chaotic: a slightly disturbed "
        + "trajectory departs exponentially. The digits are those of one trajectory.")] : []),
      valueTable, ...sag);
    const elapsedText = `${answer.elapsedMs.toFixed(answer.elapsedMs < 10 ? 1 : 0)} ms`;
    status.textContent = answer.isChecked
      ? `Checked in ${elapsedText}: estimated relative error at most `
        + `${formatSignificant(Math.max(...records.map((record) => record.error)), 2)}; `
        + `nonlinear model by ${records[0].level}, linear model by ${records[1].level}.`
      : `Preview in ${elapsedText}: peaks of both models ${answer.ms[0].toFixed(1)} ms, curves `
        + `${answer.ms.slice(1).map((ms) => ms.toFixed(1)).join(" and ")} ms, side by side.`;
  }

  // Computes a finer map of quick answers around the point, from the middle outwards.
  function refineMap() {
    pool.cancel("fine");
    fineEdges = map.region(map.sliders.slice(0, 2).map((k) => values[k]), FINE_MAP.cells);
    const steps = fineEdges.map(([low, high]) => (high - low) / FINE_MAP.points);
    const middle = (FINE_MAP.points - 1) / 2;
    const distanceToMiddle = (indices) => Math.hypot(...indices.map((index) => index - middle));
    const cells = Array.from({ length: FINE_MAP.points ** 2 },
      (_, k) => [Math.floor(k / FINE_MAP.points), k % FINE_MAP.points])
      .sort((a, b) => distanceToMiddle(a) - distanceToMiddle(b));
    [fineCells, fineRemaining] = [[], cells.length];
    map.mark();
    map.request();
    for (let k = 0; k < cells.length; k += FINE_MAP.batchSize) {
      const batch = cells.slice(k, k + FINE_MAP.batchSize).map((indices) => {
        const from = indices.map((index, axis) => fineEdges[axis][0] + index * steps[axis]);
        return { from, to: from.map((start, axis) => start + steps[axis]) };
      });
      const points = batch.flatMap(({ from }) => {
        const point = [...values];
        from.forEach((lowEnd, axis) => {
          point[map.sliders[axis]] = map.back(axis, lowEnd + 0.5 * steps[axis]);
        });
        return point;
      });
      pool.request("fine", 1, "quick", points, [values.length]).then(({ numbers }) => {
        const answerLength = numbers.length / batch.length;
        batch.forEach((cell, k) => {
          const answer = parseAnswer(numbers.slice(k * answerLength, (k + 1) * answerLength), live);
          const { ratios, byColumn } = answer;
          const extremes = { ratio_max: greatestOf(ratios), ratio_min: leastOf(ratios) };
          if (answer.is === 1) fineCells.push({ ...cell, columns: { ...byColumn, ...extremes } });
        });
        fineRemaining -= batch.length;
        panel.dataset.fine = `${fineCells.length} ${fineRemaining}`;
        map.request();
      }, showError);
    }
  }

  // Returns the sliders of axes, and the middles of their ranges.
  function withoutMap() {
    const sliders = live.sliders.flatMap((slider, k) => (slider.axis ? [k] : []));
    const findMiddle = ({ from, to, log }) => (log ? Math.sqrt(from * to) : 0.5 * (from + to));
    const start = sliders.map((k) => Number(findMiddle(live.sliders[k]).toPrecision(4)));
    return { sliders, start };
  }

  const axisSettings = (point) => point.map((value, k) => [map.sliders[k], value]);
  return {
    // The interface for the figure; `connect` passes the interface of a map to this panel.
    connect(mapInterface = withoutMap()) {
      map = mapInterface;
      refineButton.hidden = !map.region;
      setSliders(axisSettings(map.start));
    },
    pinned: (point) => setSliders(axisSettings(point)),
    // Values by name, with the 32-bit precision of the file's numbers.
    chosen: (point) => setSliders(live.sliders.flatMap(({ name }, k) => (name in point
      ? [[k, Number(point[name].toPrecision(7))]] : []))),
    values: () => [...values],
    restore: (saved) => setSliders([...saved.entries()]
      .filter(([, value]) => Number.isFinite(value))),
    hasFine: () => fineCells.length > 0,
    cells(context, layer, toPixels, colour) {
      if (!layer) return;
      for (const { from, to, columns } of fineCells) {
        const value = columns[layer.column];
        // The panel shows another point.
        if (!Number.isFinite(value)) continue;
        const [left, low] = toPixels(...from).map(Math.round);
        const [right, high] = toPixels(...to).map(Math.round);
        context.fillStyle = colour(layer, value);
        context.fillRect(left, high, right - left, low - high);
      }
    },
    over(context, toPixels) {
      if (fineEdges) {
        const [[left, low], [right, high]] = [0, 1].map((end) => toPixels(...fineEdges
          .map((ends) => ends[end])));
        context.beginPath();
        context.rect(left, high, right - left, low - high);
        strokeOutlined(context, [1.5, 1.5], [5, 4]);
      }
      const position = map.sliders.slice(0, 2).map((k, axis) => map.even(axis, values[k]));
      const [x, y] = toPixels(...position);
      context.beginPath();
      for (const [dx, dy] of [[9, 0], [0, 9]]) {
        context.moveTo(x - dx, y - dy);
        context.lineTo(x + dx, y + dy);
      }
      strokeOutlined(context, [5, 2]);
    },
  };
}

// Reads the module's answer for a point by name (`exports.rs` of washer-live), in displayed units
// under the names of a map's columns.
function parseAnswer(numbers, live) {
  const rest = [...numbers];
  const takeNumbers = (count) => rest.splice(0, count);
  const [is, sensitive] = takeNumbers(2);
  const records = [0, 1].map(() => {
    const [rung, level, error, failure, failTime, steps, gap] = takeNumbers(7);
    const amplitudes = takeNumbers(live.channels.length);
    const metrics = takeNumbers(live.metrics.length);
    return {
      rung, level: live.levels[level], error, failure, failTime, steps, gap, amplitudes, metrics,
    };
  });
  const ratios = takeNumbers(live.channels.length);
  const byColumn = { static_sag_m: rest[0] * 1e3 };
  live.channels.forEach(({ name }, k) => { byColumn[`ratio_${name}`] = ratios[k]; });
  ["nonlinear", "linear"].forEach((model, index) => {
    const { gap, amplitudes, metrics } = records[index];
    byColumn[`min_gap_${model}_m`] = gap * 1e3;
    live.channels.forEach(({ name, factor }, k) => {
      byColumn[`${model}_${name}`] = amplitudes[k] * factor;
    });
    live.metrics.forEach(({ columns, factor }, k) => {
      byColumn[columns[index]] = metrics[k] * factor;
    });
  });
  return { is, sensitive: sensitive === 1, records, ratios, sag: rest[0], byColumn };
}
