// The panel that computes: sliders, both models' peaks and curves at any point, a finer map.

// No rung has this number: the quick one is taken.
const QUICK_RUNG = 255;
// A point is checked once its sliders have rested so long, ms.
const REST = 150;
// Numbers of a record before its amplitudes, and in all beside them.
const RECORD = 4;
const FAILURES = ["", "diverged", "needs steps too small", "used up its steps"];
// Points of a finer map along each axis, how many cells it spans without a zoom, points a call.
const FINE = { points: 20, cells: 7, together: 10 };
// The highest frequency of a spectrum, Hz.
const HIGHEST = 25;

function createLive(host, data) {
  const { live } = data;
  const width = RECORD + live.channels.length;
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

  const pool = createPool(decode(live.module), doubles(live.setup), (state) => {
    if (state.error) status.textContent = `This browser cannot compute here: ${state.error}.`;
    host.querySelector("#live").dataset.ready = `${state.ready} of ${state.workers}`;
    host.querySelector("#live-workers").textContent = `${state.ready} workers, each with a module `
      + `of its own: WebAssembly with simd128, ${state.lanes} trajectories side by side.`;
  });
  const curves = createCurves(charts, live, data);

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
    map?.mark();
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
        const [is, ...numbers] = peaks.numbers;
        const records = [numbers.slice(0, width), numbers.slice(width)];
        const ms = [peaks, ...found].map((one) => one.ms);
        show({ is, records, isChecked: false, took, ms });
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
      const [is, sensitive, ...rest] = numbers;
      if (is !== 1) return;
      const size = 3 + width;
      const models = [rest.slice(0, size), rest.slice(size)];
      const took = performance.now() - started;
      show({
        is, records: models.map((model) => model.slice(3)), isChecked: true, took, ms: [ms],
        sensitive: sensitive === 1, levels: models.map((model) => live.levels[model[1]]),
        error: Math.max(...models.map((model) => model[2])),
      });
      const speeds = ask("check", 2, "speeds", [live.everyS]);
      const found = await Promise.all(motions("check", models.map((model) => model[0])));
      if (of === latest) {
        curves.show(found.map((one) => one.numbers), (await speeds).numbers);
      }
    } catch (error) {
      tellError(error);
    }
  }

  // Work that was let go fails without an error.
  function tellError(error) {
    if (!error) return;
    status.textContent = `This point could not be computed: ${error.message}. It is a defect.`;
  }

  // Both models' ratio of a channel.
  const ratioOf = ([nonlinear, linear], channel) => {
    const of = linear[RECORD + channel];
    return of === 0 ? NaN : nonlinear[RECORD + channel] / of;
  };

  function greatestOf(records) {
    let greatest = null;
    for (const channel of live.compared) {
      const ratio = ratioOf(records, channel);
      if (ratio > (greatest?.ratio ?? -Infinity)) greatest = { ratio, channel };
    }
    return greatest;
  }

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
    const { records } = answer;
    panel.dataset.records = records.flat().join(" ");
    const greatest = greatestOf(records);
    const failed = records.findIndex((record) => record[0] !== 0);
    const verdict = failed >= 0
      ? `The ${["nonlinear", "linear"][failed]} model ${FAILURES[records[failed][0]]} at `
        + `${significant(records[failed][1])} s`
      : !greatest ? "Undefined: no excitation"
        : `Linear model ${greatest.ratio < live.ratioLimit ? "" : "un"}reliable here`;
    const kind = answer.isChecked ? "Checked" : "Preview, not checked";
    const rows = live.channels.map((channel, k) => element("tr", { "data-live": channel.name },
      element("th", { scope: "row" }, withUnit(channel.words, channel.unit)),
      ...records.map((record) => element("td", {}, significant(record[RECORD + k]
        * channel.factor))),
      element("td", {}, significant(ratioOf(records, k)))));
    const gaps = element("tr", {}, element("th", { scope: "row" }, "Least gap, whole run (mm)"),
      ...records.map((record) => element("td", {}, significant(record[3] * 1e3))),
      element("td", {}));
    const heads = ["", "nonlinear", "linear", "ratio"]
      .map((text) => element("th", { scope: "col" }, text));
    const largest = greatest && `Largest ratio ${significant(greatest.ratio)} `
      + `(${live.channels[greatest.channel].words}), the limit is ${live.ratioLimit}`;
    told.replaceChildren(
      element("p", { class: "kind" }, kind),
      element("p", { class: "verdict" }, answer.isChecked ? verdict : `${verdict}?`),
      ...(largest ? [element("p", {}, largest)] : []),
      ...(answer.sensitive ? [element("p", {}, "The motion is chaotic: plain rk4 does not agree "
        + "with itself at two steps. The digits are those of one trajectory.")] : []),
      element("table", {}, element("thead", {}, element("tr", {}, ...heads)),
        element("tbody", {}, ...rows, gaps)));
    const took = `${answer.took.toFixed(answer.took < 10 ? 1 : 0)} ms`;
    status.textContent = answer.isChecked
      ? `Checked in ${took}: amplitudes within ${significant(answer.error, 2)} of themselves; `
        + `nonlinear model by ${answer.levels[0]}, linear model by ${answer.levels[1]}.`
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
          const [is, ...rest] = numbers.slice(at * (1 + 2 * width), (at + 1) * (1 + 2 * width));
          if (is === 1) fine.push({ ...cell, records: [rest.slice(0, width), rest.slice(width)] });
        });
        fineLeft -= part.length;
        host.querySelector("#live").dataset.fine = `${fine.length} ${fineLeft}`;
        map.request();
      }, tellError);
    }
  }

  // What a layer of the map shows of a finer cell; NaN where it shows something else.
  function layerValue(layer, records) {
    if (layer.group === "ratio" && !layer.channel) return greatestOf(records)?.ratio ?? NaN;
    const model = { nonlinear: 0, linear: 1 };
    if (layer.group in model || layer.group === "ratio") {
      const channel = live.channels.findIndex((one) => one.name === layer.channel);
      if (channel < 0) return NaN;
      if (layer.group === "ratio") return ratioOf(records, channel);
      return records[model[layer.group]][RECORD + channel] * live.channels[channel].factor;
    }
    const gap = { "gap-nonlinear": 0, "gap-linear": 1 }[layer.group];
    return gap === undefined ? NaN : records[gap][3] * 1e3;
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

  return {
    // The map calls these; `connect` gives what it lets this panel do.
    connect(given) {
      map = given;
      map.start.forEach((value, k) => set(map.sliders[k], value));
      changed();
    },
    pinned(place) {
      place.forEach((value, k) => set(map.sliders[k], value));
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
      for (const { from, to, records } of fine) {
        const value = layerValue(layer, records);
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

// Time histories and spectra of both models, redrawn in place.
function createCurves(host, live, data) {
  const instants = 1 + Math.floor((live.endS / live.everyS) * (1 + 1e-12));
  const times = Float32Array.from({ length: instants }, (_, k) => k * live.everyS);
  const [from, to] = live.windowS.map((at) => Math.round(at / live.everyS));
  const size = spectrumSize(to - from + 1);
  const perBin = 1 / (size * live.everyS);
  const bins = Math.min(Math.floor(HIGHEST / perBin), size / 2);
  const frequencies = Float32Array.from({ length: bins }, (_, k) => k * perBin);
  // Of the motions that are there.
  let version = 0;
  const line = (name, colour, count, alpha = 1) => ({
    name, colour, alpha, grid: 0, width: 1.3, dashed: false, y: new Float32Array(count).fill(NaN),
  });
  const both = (count) => [line("nonlinear model", "#0072b2", count),
    line("linear model", "#d55e00", count, 0.65)];
  const panel = (name, words, unit, shown, series, height = 150) => ({
    name, words, unit, shown, log: false, ticks: null, range: null, height, series, levels: [],
    stars: [], mixed: [],
  });
  const first = live.compared[Math.max(live.compared.length - 2, 0)];
  const motion = live.channels.map((channel, k) => panel(channel.name, capitalised(channel.words),
    channel.unit, k === first, both(instants)));
  const gap = panel("gap", "Gap, drum to tub", "mm", false, both(instants));
  const speed = panel("speed", "Spin", "rpm", true, [line("", "ink", instants)], 80);
  // Spectra are found when they are drawn.
  const ofWindow = (one, source) => {
    const [y, found] = [new Float32Array(bins).fill(NaN), { version: -1 }];
    return Object.defineProperty({ ...one }, "y", { get() {
      if (found.version === version) return y;
      found.version = version;
      y.set(spectrum(Array.from(source.y.subarray(from, to + 1)), live.everyS, bins));
      return y;
    } });
  };
  const spectra = live.channels.map((channel, k) => panel(channel.name,
    capitalised(channel.words), channel.unit, k === first,
    both(bins).map((one, model) => ofWindow(one, motion[k].series[model]))));
  const spec = (xWords, xUnit, grid, panels) => ({
    xWords, xUnit, xLog: false, xTicks: null, grids: [grid], panels, marks: [], markMeaning: "",
    shades: [], shadeMeaning: "",
  });
  const histories = element("div", { id: "live-histories" });
  const spectrumHost = element("div", { id: "live-spectrum" });
  host.append(element("h2", {}, "Time histories"), histories,
    element("h2", {}, `Spectrum from ${live.windowS[0]} to ${live.windowS[1]} s`), spectrumHost);
  const charts = [
    createChart(histories, spec("Time", "s", times, [...motion, gap, speed]), "Time histories"),
    createChart(spectrumHost, spec("Frequency", "Hz", frequencies, spectra), "Spectrum"),
  ];
  const columns = live.channels.length + 1;

  return {
    show(models, speeds) {
      models.forEach((numbers, model) => {
        const count = numbers[0] === 1 ? numbers[3] : 0;
        const column = (k, factor, into) => {
          for (let i = 0; i < into.length; i++) {
            into[i] = i < count ? numbers[4 + i * columns + k] * factor : NaN;
          }
        };
        live.channels.forEach((channel, k) => {
          column(k, channel.factor, motion[k].series[model].y);
        });
        column(columns - 1, 1e3, gap.series[model].y);
      });
      version += 1;
      speed.series[0].y.set(speeds.subarray(0, instants));
      charts.forEach((chart) => chart.changed());
    },
  };
}
