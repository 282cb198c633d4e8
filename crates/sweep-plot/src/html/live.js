// The panel that computes: sliders, both models' peaks and curves at any point, a finer map.

// No rung has this number: the quick one is taken.
const QUICK_RUNG = 255;
// A point is checked once its sliders have rested so long, ms.
const REST = 150;
const FAILURES = ["", "diverged", "needs steps too small", "used up its steps"];
// Points of a finer map along each axis, how many cells it spans without a zoom, points a call.
const FINE = { points: 20, cells: 7, together: 10 };

function createLive(host, data) {
  const { live } = data;
  const values = live.sliders.map((slider) => slider.value);
  let map = null;
  let latest = 0;
  let resting = 0;
  let isBusy = false;
  let isMoved = false;
  let fine = [];
  let fineLeft = 0;
  // Its ends along both axes, as the map spaces them.
  let fineEdges = null;

  const status = element("p", { id: "live-status", role: "status" }, "Starting.");
  const inputs = live.sliders.map((slider, k) => createSlider(slider, k));
  const reset = element("button", { type: "button", id: "live-reset", onclick: () => {
    live.sliders.forEach((slider, k) => { if (!slider.axis) set(k, slider.value); });
    changed();
  } }, "Other numbers as in the map");
  const refine = element("button", { type: "button", id: "refine", onclick: refineMap },
    "Finer map around this point");
  const told = element("div", { class: "readout", id: "live-values" });
  const charts = element("div");
  host.append(element("section", { id: "live", "aria-labelledby": "live-title" },
    element("h2", { id: "live-title" }, "Any point, computed in this page"),
    element("div", { class: "columns" },
      element("div", {}, element("div", { class: "sliders" }, ...inputs.map((one) => one.row)),
        element("div", { class: "controls" }, reset, refine), status),
      told),
    charts, computedWith()));

  const pool = createPool(unpacked(live.module), doubles(live.setup), (state) => {
    if (state.error) status.textContent = `This browser cannot compute here: ${state.error}.`;
    host.querySelector("#live").dataset.ready = `${state.ready} of ${state.workers}`;
    host.querySelector("#live-workers").textContent = `${state.ready} workers, each with a module `
      + `of its own: WebAssembly with simd128, ${state.lanes} trajectories side by side.`;
  });
  const curves = createCurves(charts, live);
  const growth = live.kinds.length > 0 ? createGrowth(charts, live, pool) : null;

  function createSlider(slider, k) {
    const { from, to } = slider;
    // Along a logarithmic axis the slider goes by the logarithm, and says the value.
    const [scaled, back] = slider.log ? [Math.log10, (x) => 10 ** x] : [(x) => x, (x) => x];
    const bounded = (value) => Math.min(Math.max(value, from), to);
    const number = element("input", {
      type: "number", step: "any", min: from, max: to, value: slider.value,
      "aria-label": withUnit(slider.words, slider.unit), "data-number": slider.name,
      onchange: () => {
        const typed = Number(number.value);
        set(k, Number.isFinite(typed) ? bounded(typed) : values[k]);
        changed();
      },
    });
    const range = element("input", {
      type: "range", step: "any", min: scaled(from), max: scaled(to), value: scaled(slider.value),
      "aria-label": slider.words, "data-slider": slider.name, title: slider.description,
      oninput: () => {
        set(k, bounded(Number(back(Number(range.value)).toPrecision(4))));
        changed();
      },
    });
    if (slider.log) range.setAttribute("aria-valuetext", slider.value);
    return { number, range, scaled, row: element("label", { title: slider.description },
      element("span", {}, slider.words), range, number, element("span", {}, slider.unit)) };
  }

  function set(k, value) {
    values[k] = value;
    const { number, range, scaled } = inputs[k];
    number.value = value;
    range.value = scaled(value);
    if (live.sliders[k].log) range.setAttribute("aria-valuetext", value);
  }

  function changed() {
    latest += 1;
    clearTimeout(resting);
    pool.drop("check");
    growth?.moved();
    map?.mark?.();
    if (isBusy) isMoved = true;
    else preview();
  }

  const ask = (kind, urgency, call, rest) => pool.ask(kind, urgency, call, [...values], rest);
  const motions = (kind, rungs) => [0, 1].map((model) => ask(kind, 3, "history",
    [model, rungs[model], live.everyS]));

  // Quick answers, the next as soon as the last is there; then the checked one.
  async function preview() {
    isBusy = true;
    do {
      isMoved = false;
      const started = performance.now();
      try {
        const calls = [ask("preview", 4, "quick", [values.length]),
          ...motions("preview", [QUICK_RUNG, QUICK_RUNG])];
        const speeds = ask("preview", 3, "speeds", [live.everyS]);
        const [peaks, ...found] = await Promise.all(calls);
        const took = performance.now() - started;
        const ms = [peaks, ...found].map((one) => one.ms);
        show({ ...parsedAnswer(peaks.numbers, live), isChecked: false, took, ms });
        curves.show(found.map((one) => one.numbers), (await speeds).numbers);
      } catch (error) {
        tellError(error);
      }
    } while (isMoved);
    isBusy = false;
    resting = setTimeout(() => check(latest), REST);
  }

  async function check(of) {
    try {
      const started = performance.now();
      const { numbers, ms } = await ask("check", 2, "checked");
      if (of !== latest) return;
      const answer = parsedAnswer(numbers, live);
      if (answer.is !== 1) return;
      show({ ...answer, isChecked: true, took: performance.now() - started, ms: [ms] });
      const asked = ask("check", 2, "speeds", [live.everyS]);
      const rungs = answer.records.map((record) => record.rung);
      const found = await Promise.all(motions("check", rungs));
      const speeds = (await asked).numbers;
      if (of === latest) {
        curves.show(found.map((one) => one.numbers), speeds);
        if (live.growthSpeeds.length) tellGrowth(of).catch(tellError);
        growth?.rested([...values], speeds.reduce((most, speed) => Math.max(most, speed)));
      }
    } catch (error) {
      tellError(error);
    }
  }

  // The map's own metric, over the speeds that it is about.
  async function tellGrowth(of) {
    const line = element("p", { id: "growth-metric" }, "Growth at constant speeds: computing.");
    told.append(line);
    const { numbers } = await pool.ask("check", 1, "growth", [...values, ...live.growthSpeeds],
      [values.length]);
    if (of !== latest) return;
    let most = null;
    live.growthSpeeds.forEach((speed, k) => {
      const growth = numbers[1 + 3 * k];
      if (growth > (most?.growth ?? -Infinity)) most = { growth, speed };
    });
    line.textContent = most ? `Growth at most ${significant(most.growth, 3)} /s, at `
      + `${significant(most.speed)} rpm of ${live.growthSpeeds.length} constant speeds`
      : "No response at any of the map's constant speeds";
    line.dataset.growth = most?.growth;
  }

  // Work that was let go fails without an error.
  function tellError(error) {
    if (!error) return;
    status.textContent = `This point could not be computed: ${error.message}. It is a defect.`;
  }

  function greatestOf(ratios) {
    let greatest = null;
    for (const channel of live.compared) {
      const ratio = ratios[channel];
      if (ratio > (greatest?.ratio ?? -Infinity)) greatest = { ratio, channel };
    }
    return greatest;
  }

  const leastOf = (ratios) => Math.min(...live.compared.map((channel) => ratios[channel])
    .filter(Number.isFinite));
  const isTrusted = (ratios) => greatestOf(ratios).ratio < live.ratioLimit
    && (live.ratioMin === null || leastOf(ratios) > live.ratioMin);

  function show(answer) {
    const panel = host.querySelector("#live");
    panel.dataset.kind = answer.isChecked ? "checked" : "preview";
    panel.dataset.point = values.join(" ");
    panel.dataset.ms = answer.ms.join(" ");
    if (answer.is !== 1) {
      told.replaceChildren(element("p", { class: "verdict" }, answer.is === 0
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
    const greatest = greatestOf(ratios);
    const failed = records.findIndex((record) => record.failure !== 0);
    const verdict = failed >= 0
      ? `The ${["nonlinear", "linear"][failed]} model ${FAILURES[records[failed].failure]} at `
        + `${significant(records[failed].failTime)} s`
      : !greatest ? "Undefined: no excitation"
        : `Linear model ${isTrusted(ratios) ? "" : "un"}reliable here`;
    const kind = answer.isChecked ? "Checked" : "Preview, not checked";
    const row = (words, unit, of, beside = "") => element("tr", {},
      element("th", { scope: "row" }, withUnit(words, unit)),
      ...records.map((record) => element("td", {}, significant(of(record)))),
      element("td", {}, beside));
    const rows = live.channels.map((channel, k) => row(channel.words, channel.unit,
      (record) => record.amplitudes[k] * channel.factor, significant(ratios[k])));
    rows.push(row("Least gap, whole run", "mm", (record) => record.gap * 1e3));
    live.metrics.forEach((metric, k) => rows.push(row(metric.words, metric.unit,
      (record) => record.metrics[k] * metric.factor)));
    const sag = live.staticSag
      ? [element("p", {}, `Static sag of the tub ${significant(answer.sag * 1e3)} mm`)] : [];
    const largest = greatest && `Largest ratio ${significant(greatest.ratio)} `
      + `(${live.channels[greatest.channel].words}), the limit is ${live.ratioLimit}`;
    told.replaceChildren(
      element("p", { class: "kind" }, kind),
      element("p", { class: "verdict" }, answer.isChecked ? verdict : `${verdict}?`),
      ...(largest ? [element("p", {}, largest)] : []),
      ...(answer.sensitive ? [element("p", {}, "The motion is chaotic: a near twin departs "
        + "exponentially. The digits are those of one trajectory.")] : []),
      element("table", {},
        element("caption", {}, `${capitalised(live.criterion[0])}. Ratio: ${live.criterion[1]}.`),
        tableHead(["", "nonlinear", "linear", "ratio"]), element("tbody", {}, ...rows)),
      ...sag);
    const took = `${answer.took.toFixed(answer.took < 10 ? 1 : 0)} ms`;
    status.textContent = answer.isChecked
      ? `Checked in ${took}: numbers within `
        + `${significant(Math.max(...records.map((record) => record.error)), 2)} of themselves; `
        + `nonlinear model by ${records[0].level}, linear model by ${records[1].level}.`
      : `Preview in ${took}: peaks of both models ${answer.ms[0].toFixed(1)} ms, curves `
        + `${answer.ms.slice(1).map((ms) => ms.toFixed(1)).join(" and ")} ms, side by side.`;
  }

  // A finer map: quick answers around the point, from the middle outwards.
  function refineMap() {
    pool.drop("fine");
    const edges = map.region([values[map.sliders[0]], values[map.sliders[1]]], FINE.cells);
    fineEdges = edges;
    const step = edges.map(([low, high]) => (high - low) / FINE.points);
    const places = [];
    for (let i = 0; i < FINE.points; i++) {
      for (let j = 0; j < FINE.points; j++) places.push([i, j]);
    }
    const middle = (FINE.points - 1) / 2;
    const far = ([i, j]) => Math.hypot(i - middle, j - middle);
    places.sort((a, b) => far(a) - far(b));
    [fine, fineLeft] = [[], places.length];
    map.mark();
    map.request();
    for (let k = 0; k < places.length; k += FINE.together) {
      const part = places.slice(k, k + FINE.together).map((place) => {
        const cell = place.map((at, axis) => edges[axis][0] + at * step[axis]);
        return { from: cell, to: cell.map((at, axis) => at + step[axis]) };
      });
      const points = part.flatMap(({ from }) => {
        const point = [...values];
        from.forEach((even, axis) => {
          point[map.sliders[axis]] = map.back(axis, even + 0.5 * step[axis]);
        });
        return point;
      });
      pool.ask("fine", 1, "quick", points, [values.length]).then(({ numbers }) => {
        part.forEach((cell, at) => {
          const width = numbers.length / part.length;
          const answer = parsedAnswer(numbers.slice(at * width, (at + 1) * width), live);
          if (answer.is === 1) fine.push({ ...cell, answer });
        });
        fineLeft -= part.length;
        host.querySelector("#live").dataset.fine = `${fine.length} ${fineLeft}`;
        map.request();
      }, tellError);
    }
  }

  // What a layer of the map shows of a finer cell; NaN where it shows something else.
  function layerValue(layer, { records, ratios, sag }) {
    if (layer.column === "ratio_max") return greatestOf(ratios)?.ratio ?? NaN;
    if (layer.column === "ratio_min") return leastOf(ratios);
    const model = { nonlinear: 0, linear: 1 };
    if (layer.group in model || layer.group === "ratio") {
      const channel = live.channels.findIndex((one) => one.name === layer.channel);
      if (channel < 0) return NaN;
      if (layer.group === "ratio") return ratios[channel];
      return records[model[layer.group]].amplitudes[channel] * live.channels[channel].factor;
    }
    const gap = ["min_gap_nonlinear_m", "min_gap_linear_m"].indexOf(layer.column);
    if (gap >= 0) return records[gap].gap * 1e3;
    if (layer.column === "static_sag_m") return sag * 1e3;
    for (const [k, { columns, factor }] of live.metrics.entries()) {
      const of = columns.indexOf(layer.column);
      if (of >= 0) return records[of].metrics[k] * factor;
    }
    return NaN;
  }

  function computedWith() {
    const list = (texts) => element("ul", {}, ...texts.map((text) => element("li", {}, text)));
    return element("details", { id: "computed-with" },
      element("summary", {}, "What this page computes with"),
      element("p", {}, `The models and integrators of sweep ${live.version}, as a WebAssembly `
        + "module in this file. Nothing is fetched. WebAssembly has no fused multiply-add, so the "
        + "last digits differ from the program's; at reliable points by less than 1e-9 of a peak."),
      element("p", { id: "live-workers" }),
      element("p", {}, `A preview is one run of each model. A checked point is run in finer and `
        + `finer steps until two runs agree within ${live.accuracy}, as a row of the map. `
        + `Amplitudes are taken from ${live.windowS[0]} to ${live.windowS[1]} s.`),
      element("p", {}, "Nonlinear model, while only axes move:"), list(live.rungs[0]),
      element("p", {}, "Linear model:"), list(live.rungs[1]));
  }

  // The sliders of axes, and the middles of their ranges.
  function alone() {
    const sliders = live.sliders.flatMap((slider, k) => (slider.axis ? [k] : []));
    const middle = ({ from, to, log }) => (log ? Math.sqrt(from * to) : 0.5 * (from + to));
    return { sliders, start: sliders.map((k) => Number(middle(live.sliders[k]).toPrecision(4))) };
  }

  return {
    // The figure calls these; `connect` gives what a map lets this panel do.
    connect(given = alone()) {
      map = given;
      refine.hidden = !map.region;
      map.start.forEach((value, k) => set(map.sliders[k], value));
      changed();
    },
    pinned(place) {
      place.forEach((value, k) => set(map.sliders[k], value));
      changed();
    },
    // By name; as a file's numbers of 32 bits.
    chosen(point) {
      live.sliders.forEach(({ name }, k) => {
        if (name in point) set(k, Number(point[name].toPrecision(7)));
      });
      changed();
    },
    values: () => [...values],
    restore(given) {
      given.forEach((value, k) => { if (Number.isFinite(value)) set(k, value); });
      changed();
    },
    hasFine: () => fine.length > 0,
    cells(context, layer, at, colour) {
      if (!layer) return;
      for (const { from, to, answer } of fine) {
        const value = layerValue(layer, answer);
        if (!Number.isFinite(value)) continue;
        const [left, low] = at(...from).map(Math.round);
        const [right, high] = at(...to).map(Math.round);
        context.fillStyle = colour(layer, value);
        context.fillRect(left, high, right - left, low - high);
      }
    },
    over(context, at) {
      if (fineEdges) {
        const [[left, low], [right, high]] = [0, 1].map((end) => at(...fineEdges
          .map((ends) => ends[end])));
        for (const [colour, dash] of [["#ffffff", []], ["#1b1f24", [5, 4]]]) {
          context.strokeStyle = colour;
          context.lineWidth = 1.5;
          context.setLineDash(dash);
          context.strokeRect(left, high, right - left, low - high);
        }
        context.setLineDash([]);
      }
      const [x, y] = at(...map.sliders.slice(0, 2).map((k, axis) => map.even(axis, values[k])));
      for (const [colour, thick] of [["#ffffff", 5], ["#1b1f24", 2]]) {
        context.strokeStyle = colour;
        context.lineWidth = thick;
        context.beginPath();
        for (const [dx, dy] of [[1, 0], [0, 1]]) {
          context.moveTo(x - 9 * dx, y - 9 * dy);
          context.lineTo(x + 9 * dx, y + 9 * dy);
        }
        context.stroke();
      }
    },
  };
}

// What the module answers of a point, by name (`exports.rs` of washer-live).
function parsedAnswer(numbers, live) {
  const rest = [...numbers];
  const take = (count) => rest.splice(0, count);
  const [is, sensitive] = take(2);
  const records = [0, 1].map(() => {
    const [rung, level, error, failure, failTime, steps, gap] = take(7);
    const [amplitudes, metrics] = [take(live.channels.length), take(live.metrics.length)];
    return {
      rung, level: live.levels[level], error, failure, failTime, steps, gap, amplitudes, metrics,
    };
  });
  const ratios = take(live.channels.length);
  return { is, sensitive: sensitive === 1, records, ratios, sag: rest[0] };
}
