// How fast small disturbances grow while the drum turns at constant speeds, of the panel's point.

// The least speed that is asked for, rpm; about how many are; how many a call takes.
const GROWTH = { from: 50, speeds: 300, together: 10 };

function createGrowth(host, live, pool) {
  const about = element("p", { id: "growth-status", role: "status" });
  const chartHost = element("div", { id: "live-growth-chart" });
  const box = element("details", { id: "live-growth", ontoggle: () => compute() },
    element("summary", {}, "Growth of disturbances at constant speeds"),
    element("p", {}, "At a constant speed the nonlinear model has a motion that repeats with each "
      + "turn of the drum. Where small disturbances of this motion grow (above zero), it does not "
      + "last, and the linear model fails."),
    about, chartHost);
  host.append(box);
  let point = null;
  let isDone = true;
  let asked = 0;
  let chart = null;
  let spec = null;

  // Speeds up to the fastest of the spin, in whole steps.
  function speedsUpTo(peak) {
    const from = Math.min(GROWTH.from, peak / 4);
    const step = Math.max(1, Math.round((peak - from) / GROWTH.speeds));
    const count = Math.max(2, 1 + Math.floor((peak - from) / step + 1e-6));
    return Float32Array.from({ length: count }, (_, k) => from + step * k);
  }

  function drawOver(speeds) {
    const empty = () => new Float32Array(speeds.length).fill(NaN);
    const line = () => [{ ...plainLine("", "#0072b2", empty()), width: 1.6 }];
    const growth = plainPanel("growth", "Growth", "1/s", true, line(), 200);
    growth.levels = [[0, "neither growth nor decay"]];
    const frequency = plainPanel("frequency", "Frequency", "cycles/min", true, line(), 110);
    spec = plainChart("Spin speed", "rpm", speeds, [growth, frequency]);
    spec.shadeMeaning = "disturbances grow";
    chartHost.replaceChildren();
    chart = createChart(chartHost, spec, "Growth of disturbances over speed");
  }

  // Runs of speeds at which disturbances grow, in words.
  function tongues(speeds, kinds) {
    const { y } = spec.panels[0].series[0];
    const found = [];
    for (let k = 0; k < speeds.length; k++) {
      if (!(y[k] > 0)) continue;
      const last = found.at(-1);
      if (last?.to === k - 1) last.to = k;
      else found.push({ from: k, to: k, most: k });
      const now = found.at(-1);
      if (y[k] > y[now.most]) now.most = k;
    }
    spec.shades = found.map(({ from, to }) => [speeds[from], speeds[to]]);
    return found.map(({ from, to, most }) => `from ${significant(speeds[from])} to `
      + `${significant(speeds[to])} rpm (${live.kinds[kinds[most]]}, at most `
      + `${significant(y[most], 3)}/s at ${significant(speeds[most])} rpm)`);
  }

  async function compute() {
    if (!box.open || !point || isDone) return;
    isDone = true;
    asked += 1;
    const of = asked;
    const speeds = speedsUpTo(point.peak);
    const kinds = new Uint8Array(speeds.length);
    const started = performance.now();
    drawOver(speeds);
    about.textContent = "Computing.";
    const parts = [];
    for (let k = 0; k < speeds.length; k += GROWTH.together) {
      const part = speeds.subarray(k, k + GROWTH.together);
      const numbers = [...point.values, ...part];
      const answer = pool.ask("growth", 0, "growth", numbers, [point.values.length]);
      parts.push(answer.then((given) => {
        if (of !== asked) return;
        const [, ...rest] = given.numbers;
        part.forEach((_, at) => {
          const [growth, frequency, kind] = rest.slice(3 * at, 3 * at + 3);
          spec.panels[0].series[0].y[k + at] = growth;
          spec.panels[1].series[0].y[k + at] = frequency;
          kinds[k + at] = kind;
        });
        chart.changed();
      }));
    }
    try {
      await Promise.all(parts);
    } catch (error) {
      if (error && of === asked) about.textContent = `It could not be computed: ${error.message}.`;
      return;
    }
    if (of !== asked) return;
    const seconds = ((performance.now() - started) / 1000).toFixed(1);
    const found = tongues(speeds, kinds);
    chart.changed();
    const said = found.length ? `Disturbances grow ${found.join(", and ")}.`
      : "Disturbances decay at every speed.";
    about.textContent = `${said} ${speeds.length} speeds in ${seconds} s.`;
    box.dataset.speeds = speeds.join(" ");
    box.dataset.growth = spec.panels[0].series[0].y.join(" ");
    box.dataset.point = point.values.join(" ");
  }

  return {
    // The point is another from now on.
    moved() {
      asked += 1;
      pool.drop("growth");
      point = null;
      if (box.open) about.textContent = "The point moves.";
    },
    // It rests here, with this greatest speed.
    rested(values, peak) {
      point = { values, peak };
      isDone = false;
      compute();
    },
  };
}
